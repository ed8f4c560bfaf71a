// SPDX-License-Identifier: BSD-3-Clause
#include "io/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace bocst::io {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(what + ": " + std::generic_category().message(errno));
}

void refuseOtherKinds(const struct stat& status) {
  switch (status.st_mode & S_IFMT) {
    case S_IFREG:
      return;
    case S_IFDIR:
      throw std::runtime_error("is a directory");
    case S_IFIFO:
      throw std::runtime_error("is a FIFO, not a regular file");
    case S_IFSOCK:
      throw std::runtime_error("is a socket, not a regular file");
    default:
      throw std::runtime_error("is a device, not a regular file");
  }
}

struct Descriptor {
  int fd;
  ~Descriptor() { close(fd); }
};

}  // namespace

std::string readFile(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    if (errno == ENOENT) throw std::runtime_error("no such file");
    fail("cannot be opened");
  }
  refuseOtherKinds(status);  // some devices act when they are opened
  const Descriptor file{open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)};
  if (file.fd < 0) fail("cannot be opened");
  if (fstat(file.fd, &status) != 0) fail("cannot be read");
  refuseOtherKinds(status);  // it may have become another one in between

  std::string content(static_cast<std::size_t>(status.st_size) + 1, '\0');  // one more, to see the end
  std::size_t size = 0;
  while (true) {
    const ssize_t got = read(file.fd, content.data() + size, content.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail("cannot be read");
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
    if (size == content.size()) content.resize(2 * size);
  }
  content.resize(size);
  if (content.empty()) throw std::runtime_error("is empty");
  if (content.rfind("version https://git-lfs", 0) == 0) {
    throw std::runtime_error("is a Git LFS pointer, not the file itself: `git lfs pull` fetches it");
  }
  return content;
}

}  // namespace bocst::io
