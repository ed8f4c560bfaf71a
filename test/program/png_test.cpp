// SPDX-License-Identifier: BSD-3-Clause
#include "picture/png.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

#include "temporary_folder.h"

namespace bocst {
namespace {

namespace fs = std::filesystem;
using program::Pen;
using program::Picture;

class Png : public testing::Test, protected test::TemporaryFolder {};

const unsigned char* pixel(const Picture& picture, int x, int y) {
  cairo_surface_flush(picture.get());
  return cairo_image_surface_get_data(picture.get()) + y * cairo_image_surface_get_stride(picture.get()) + 4 * x;
}

TEST_F(Png, ReadsAsItWasDrawn) {
  const Picture drawn = program::whitePicture(7, 5);
  const Pen pen = program::penOn(drawn);
  cairo_set_source_rgb(pen.get(), 1, 0, 0);
  cairo_rectangle(pen.get(), 2, 1, 3, 2);
  cairo_fill(pen.get());
  const std::string file = (folder_ / "a.png").string();
  program::writePng(file, drawn);

  const Picture read(cairo_image_surface_create_from_png(file.c_str()));
  ASSERT_EQ(cairo_image_surface_get_width(read.get()), 7);
  ASSERT_EQ(cairo_image_surface_get_height(read.get()), 5);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      const bool red = x >= 2 && x < 5 && y >= 1 && y < 3;
      const unsigned char* const got = pixel(read, x, y);
      EXPECT_EQ(int{got[0]}, red ? 0 : 255) << x << " " << y;
      EXPECT_EQ(int{got[2]}, 255) << x << " " << y;
    }
  }
}

TEST_F(Png, IsWrittenWholeOrNotAtAll) {
  const Picture picture = program::whitePicture(64, 64);
  EXPECT_THROW(program::writePng((folder_ / "none" / "a.png").string(), picture), std::runtime_error);
  if (fs::exists("/dev/full")) {
    EXPECT_THROW(program::writePng("/dev/full", picture), std::runtime_error);
  }
  EXPECT_TRUE(fs::is_empty(folder_));
  const fs::path file = folder_ / "a.png";
  program::writePng(file.string(), picture);
  std::ifstream stream(file, std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(stream), {}), program::png(picture));
}

TEST_F(Png, MistakesOfDrawingAreErrors) {
  EXPECT_THROW(program::whitePicture(1 << 20, 1), std::runtime_error);
  EXPECT_THROW(program::whitePicture(-1, 1), std::runtime_error);
  const Picture picture = program::whitePicture(4, 4);
  cairo_surface_finish(picture.get());
  EXPECT_THROW(program::penOn(picture), std::runtime_error);
  EXPECT_THROW(program::png(picture), std::runtime_error);
}

}  // namespace
}  // namespace bocst
