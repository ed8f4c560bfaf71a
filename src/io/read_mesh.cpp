// SPDX-License-Identifier: BSD-3-Clause
#include "io/read_mesh.h"

#include <stdexcept>

#include "io/text.h"

namespace bocst::io {

Polygons readMesh(std::string_view bytes, Format format) {
  if (format != Format::kStl) bytes = withoutByteOrderMark(bytes);  // a binary STL may begin with any bytes
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
