// SPDX-License-Identifier: BSD-3-Clause
#include "read_mesh.h"

#include <stdexcept>

namespace bocst::io {

Polygons readMesh(std::string_view bytes, Format format) {
  switch (format) {
    case Format::kObj:
      return readObj(bytes);
    case Format::kPly:
      return readPly(bytes);
    case Format::kStl:
      return readStl(bytes);
    case Format::kOff:
      return readOff(bytes);
    case Format::kDae:
      return readDae(bytes);
  }
  throw std::invalid_argument("no such mesh format");
}

}  // namespace bocst::io
