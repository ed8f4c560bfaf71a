// SPDX-License-Identifier: BSD-3-Clause
#include "cli/file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace bocst::program {
namespace {

namespace fs = std::filesystem;

// What a signal handler may look at: the partial file of the moment.
volatile sig_atomic_t partial_exists = 0;
char partial_name[PATH_MAX];
bool stderr_is_terminal = false;
// What readFile() has read.
std::vector<fs::path> read_files;

[[noreturn]] void cannotWrite(const std::string& file, int error) {
  throw std::runtime_error(file + ": cannot be written: " + std::generic_category().message(error));
}

fs::path folderOf(const fs::path& file) {
  const fs::path folder = file.parent_path();
  return folder.empty() ? fs::path(".") : folder;
}

/// Pipes and devices have no "whole or not at all".
bool isSpecial(const std::string& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

/// What a link points to is written, not the link; also where that is not there yet.
fs::path targetOf(const std::string& file) {
  std::error_code error;
  fs::path at = file;
  constexpr int kMostLinks = 40;  // as the kernel
  for (int links = 0; links < kMostLinks && fs::is_symlink(at, error); ++links) {
    at = folderOf(at) / fs::read_symlink(at, error);
  }
  const fs::path target = fs::weakly_canonical(at, error);
  return error ? fs::path(file) : target;
}

/// A file that is there must be writable, though another would take its place.
void checkWritable(const fs::path& target, const std::string& file) {
  if (::access(folderOf(target).c_str(), W_OK) != 0) cannotWrite(file, errno);
  if (::access(target.c_str(), W_OK) != 0 && errno != ENOENT) cannotWrite(file, errno);
}

void writeAll(int fd, const std::string& text, const std::string& file) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t n = ::write(fd, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) cannotWrite(file, errno);
    done += static_cast<std::size_t>(n);
  }
}

/// A file beside its place that goes away unless it is put there.
class Partial {
 public:
  Partial(const fs::path& target, const std::string& file) : target_(target), file_(file) {
    const std::string name = (folderOf(target) / ("." + target.filename().string() + ".XXXXXX")).string();
    if (name.size() >= sizeof(partial_name)) cannotWrite(file, ENAMETOOLONG);
    // Nothing may interrupt between the making of the file and the note that it is there.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    std::memcpy(partial_name, name.c_str(), name.size() + 1);
    fd_ = ::mkstemp(partial_name);
    const int error = errno;
    partial_exists = fd_ >= 0;
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    if (fd_ < 0) cannotWrite(file, error);
  }
  ~Partial() {
    if (fd_ >= 0) ::close(fd_);
    if (partial_exists) ::unlink(partial_name);
    partial_exists = 0;
  }
  Partial(const Partial&) = delete;
  Partial& operator=(const Partial&) = delete;

  void write(const std::string& text) {
    writeAll(fd_, text, file_);
    const mode_t mask = ::umask(0);
    ::umask(mask);
    struct stat before;
    const mode_t mode = ::stat(target_.c_str(), &before) == 0 ? before.st_mode & 07777 : 0666 & ~mask;
    if (::fchmod(fd_, mode) != 0) cannotWrite(file_, errno);
  }

  void putInPlace() {
    const int code = ::close(fd_);
    fd_ = -1;
    if (code != 0 || std::rename(partial_name, target_.c_str()) != 0) cannotWrite(file_, errno);
    partial_exists = 0;
  }

 private:
  fs::path target_;
  std::string file_;
  int fd_ = -1;
};

void say(const char* text) { [[maybe_unused]] const ssize_t n = ::write(STDERR_FILENO, text, std::strlen(text)); }

// Only calls that are safe in a signal handler.
void cleanUp(int signal) {
  if (partial_exists) ::unlink(partial_name);
  if (stderr_is_terminal) say("\r\033[K");
  say("bocst: interrupted\n");
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

}  // namespace

void checkOutputs(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs) {
  std::vector<fs::path> taken = read_files;
  for (const std::string& input : inputs) taken.push_back(targetOf(input));
  for (const std::string& file : outputs) {
    if (file.empty() || file == "-") continue;
    std::error_code error;
    if (fs::is_directory(file, error)) cannotWrite(file, EISDIR);
    if (isSpecial(file)) {
      if (::access(file.c_str(), W_OK) != 0) cannotWrite(file, errno);
      continue;
    }
    const fs::path target = targetOf(file);
    checkWritable(target, file);
    if (std::find(taken.begin(), taken.end(), target) != taken.end()) {
      throw std::runtime_error(file + ": would be overwritten: it is also another file of this command");
    }
    taken.push_back(target);
  }
}

std::string readFile(const std::string& file) {
  std::error_code error;
  if (fs::is_directory(file, error)) throw std::runtime_error(file + ": is a directory");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  constexpr std::size_t kMost = std::size_t{1} << 32, kAtOnce = std::size_t{1} << 16;  // some devices have no end
  std::string text;
  while (stream && text.size() <= kMost) {
    const std::size_t size = text.size();
    text.resize(size + kAtOnce);
    stream.read(text.data() + size, static_cast<std::streamsize>(kAtOnce));
    text.resize(size + static_cast<std::size_t>(stream.gcount()));
  }
  if (text.size() > kMost) throw std::runtime_error(file + ": is larger than 4 GiB");
  if (!stream.eof()) {
    throw std::runtime_error(file + ": cannot be read: " + std::generic_category().message(errno != 0 ? errno : EIO));
  }
  read_files.push_back(targetOf(file));
  return text;
}

void writeFile(const std::string& file, const std::string& text) {
  if (isSpecial(file)) {
    const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
    if (fd < 0) cannotWrite(file, errno);
    try {
      writeAll(fd, text, file);
    } catch (...) {
      ::close(fd);
      throw;
    }
    if (::close(fd) != 0) cannotWrite(file, errno);
    return;
  }
  const fs::path target = targetOf(file);
  checkWritable(target, file);
  Partial partial(target, file);
  partial.write(text);
  partial.putInPlace();
}

void cleanUpOnSignals() {
  stderr_is_terminal = ::isatty(STDERR_FILENO) == 1;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action = {};
    // What the caller chose to ignore (nohup) stays ignored.
    if (::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN) continue;
    action = {};
    action.sa_handler = cleanUp;
    ::sigaction(signal, &action, nullptr);
  }
}

}  // namespace bocst::program
