// SPDX-License-Identifier: BSD-3-Clause
//
// Runs a target: on files, or on mutations of a corpus for some time. With libFuzzer (BOCST_LIBFUZZER) it is only the
// entry point that libFuzzer asks for.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "fuzz/fuzz.h"

#ifdef BOCST_LIBFUZZER

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    bocst::fuzz::testOneInput(data, size);
  } catch (const bocst::fuzz::Failure& failure) {
    std::fprintf(stderr, "FAILED: %s\n", failure.what());
    std::abort();
  }
  return 0;
}

#else

#include <fcntl.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <vector>

namespace {

namespace fs = std::filesystem;
using Input = std::vector<std::uint8_t>;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kLongest = 4096;

Input read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return Input(std::istreambuf_iterator<char>(in), {});
}

// What is being run, for the handler of signals.
Input current;
char crash_file[512];

extern "C" void onCrash(int signal) {
  const int file = open(crash_file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file >= 0 && write(file, current.data(), current.size()) >= 0) {
    const char text[] = "FAILED: crash or no end; the input is in ";
    if (write(2, text, sizeof text - 1) < 0 || write(2, crash_file, std::strlen(crash_file)) < 0) _exit(1);
    if (write(2, "\n", 1) < 0) _exit(1);
  }
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

// Of processor time, as machines are shared; what waits for ever is ended later. 0: no limit.
void limitTime(unsigned seconds) {
  itimerval timer{};
  timer.it_value.tv_sec = seconds;
  setitimer(ITIMER_PROF, &timer, nullptr);
  alarm(30 * seconds);
}

/// Empty when all is well, else what is wrong.
std::string test(const Input& input, unsigned seconds) {
  current = input;
  limitTime(seconds);
  std::string wrong;
  try {
    bocst::fuzz::testOneInput(current.data(), current.size());
  } catch (const std::exception& e) {
    wrong = e.what();
  }
  limitTime(0);
  return wrong;
}

class Mutator {
 public:
  Mutator(std::vector<Input> corpus, std::uint64_t seed) : corpus_(std::move(corpus)), random_(seed) {
    for (const char* const* t = bocst::fuzz::kTokens; *t != nullptr; ++t) tokens_.emplace_back(*t);
  }

  Input next() {
    Input input;
    // Where inputs are no text, random ones are as good as others.
    if (corpus_.empty() || below(tokens_.empty() ? 2 : 8) == 0) {
      input.resize(below(400));
      for (auto& byte : input) byte = static_cast<std::uint8_t>(below(256));
    } else {
      input = corpus_[below(corpus_.size())];
    }
    for (std::size_t n = 1 + below(8); n > 0; --n) mutate(input);
    if (input.size() > kLongest) input.resize(kLongest);
    return input;
  }

 private:
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(random_() % n); }

  void mutate(Input& input) {
    const std::size_t at = below(input.size() + 1), length = std::min(input.size() - at, 1 + below(16));
    const auto from = input.begin() + static_cast<std::ptrdiff_t>(at), to = from + static_cast<std::ptrdiff_t>(length);
    switch (below(tokens_.empty() ? 7 : 10)) {
      case 0:
        input.erase(from, to);
        break;
      case 1: {
        const Input copy(from, to);
        const auto where = static_cast<std::ptrdiff_t>(below(input.size() + 1));
        input.insert(input.begin() + where, copy.begin(), copy.end());
        break;
      }
      case 2:
      case 3:
        if (length > 0) *from = static_cast<std::uint8_t>(below(256));
        break;
      case 4:
        if (length > 0) *from = static_cast<std::uint8_t>(*from ^ (1u << below(8)));
        break;
      case 5:
        if (!corpus_.empty()) {
          const Input& other = corpus_[below(corpus_.size())];
          const auto half = static_cast<std::ptrdiff_t>(below(other.size() + 1));
          input.erase(from, input.end());
          input.insert(input.end(), other.begin() + half, other.end());
        }
        break;
      case 6:
        std::fill(from, to, static_cast<std::uint8_t>(below(2) == 0 ? 0 : below(256)));
        break;
      default: {
        const std::string& token = tokens_[below(tokens_.size())];
        if (below(2) == 0) input.erase(from, to);
        input.insert(input.begin() + static_cast<std::ptrdiff_t>(at), token.begin(), token.end());
      }
    }
  }

  std::vector<Input> corpus_;
  std::vector<std::string> tokens_;
  std::mt19937_64 random_;
};

/// The same failure with fewer bytes, or with more zeros.
Input reduced(Input input, const std::string& wrong, unsigned limit, long seconds) {
  const std::string kind = wrong.substr(0, wrong.find_first_of(":0123456789"));
  const auto fails = [&](const Input& candidate) { return test(candidate, limit).compare(0, kind.size(), kind) == 0; };
  const auto end = Clock::now() + std::chrono::seconds(seconds);
  for (std::size_t step = std::max<std::size_t>(input.size() / 2, 1); step >= 1; step /= 2) {
    for (std::size_t at = 0; at < input.size() && Clock::now() < end; at += step) {
      const std::size_t length = std::min(step, input.size() - at);
      const auto from = static_cast<std::ptrdiff_t>(at), to = static_cast<std::ptrdiff_t>(at + length);
      Input shorter = input, blank = input;
      shorter.erase(shorter.begin() + from, shorter.begin() + to);
      std::fill(blank.begin() + from, blank.begin() + to, std::uint8_t{0});
      if (fails(shorter)) {
        input = shorter;
      } else if (blank != input && fails(blank)) {
        input = blank;
      }
    }
  }
  return input;
}

int usage(const char* name) {
  std::fprintf(stderr,
               "usage: %s FILE...\n"
               "       %s --corpus FOLDER --seconds N [--seed K] [--out FOLDER] [--failures N]\n"
               "          [--limit SECONDS an input may take] [--reduce SECONDS to make a failing input smaller]\n",
               name, name);
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  std::map<std::string, std::string> options{{"--corpus", ""},    {"--seconds", ""}, {"--seed", "1"},   {"--out", "."},
                                             {"--failures", "1"}, {"--limit", "20"}, {"--reduce", "20"}};
  std::vector<fs::path> files;
  for (int i = 1; i < argc; ++i) {
    const auto option = options.find(argv[i]);
    if (option != options.end() && i + 1 < argc) {
      option->second = argv[++i];
    } else if (argv[i][0] == '-') {
      return usage(argv[0]);
    } else {
      files.emplace_back(argv[i]);
    }
  }
  try {
    if (files.empty() == options["--seconds"].empty()) return usage(argv[0]);
    const auto limit = static_cast<unsigned>(std::stoul(options["--limit"]));
    const fs::path out = options["--out"];
    fs::create_directories(out);
    std::snprintf(crash_file, sizeof crash_file, "%s", (out / "crash.input").c_str());
    for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGALRM, SIGPROF}) std::signal(signal, onCrash);

    std::size_t failures = 0;
    const auto report = [&](const std::string& name, const std::string& wrong) {
      ++failures;
      std::printf("FAILED %s: %s\n", name.c_str(), wrong.c_str());
      std::fflush(stdout);
    };
    std::vector<Input> corpus;
    if (!options["--corpus"].empty()) {
      for (const auto& entry : fs::recursive_directory_iterator(options["--corpus"])) {
        if (entry.is_regular_file()) files.push_back(entry.path());
      }
      std::sort(files.begin(), files.end());
    }
    for (const fs::path& file : files) {
      corpus.push_back(read(file));
      const std::string wrong = test(corpus.back(), limit);
      if (!wrong.empty()) report(file.string(), wrong);
    }
    if (!options["--seconds"].empty()) {
      const std::size_t enough = std::stoul(options["--failures"]);
      Mutator mutator(corpus, std::stoull(options["--seed"]));
      const auto end = Clock::now() + std::chrono::seconds(std::stol(options["--seconds"]));
      auto next_line = Clock::now() + std::chrono::minutes(10);
      while (Clock::now() < end && failures < enough) {
        const Input input = mutator.next();
        const std::string wrong = test(input, limit);
        if (!wrong.empty()) {
          const Input least = reduced(input, wrong, limit, std::stol(options["--reduce"]));
          const fs::path file = out / ("failure-" + std::to_string(failures) + ".input");
          std::ofstream(file, std::ios::binary)
              .write(reinterpret_cast<const char*>(least.data()), static_cast<std::streamsize>(least.size()));
          report(file.string(), test(least, limit));
        }
        if (Clock::now() > next_line) {
          std::printf("%s\n", bocst::fuzz::summary().c_str());
          std::fflush(stdout);
          next_line += std::chrono::minutes(10);
        }
      }
    }
    std::printf("%s; %zu failures\n", bocst::fuzz::summary().c_str(), failures);
    return failures == 0 ? 0 : 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", argv[0], e.what());
    return 2;
  }
}

#endif
