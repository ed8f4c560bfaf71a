// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/layout.h"

namespace bocst::oracle::gl::layout {
namespace {

struct Constant {
  const char* name;
  std::uint32_t value;
};

using namespace bounds;
#define BOCST_NAMED(name) \
  { #name, static_cast < std::uint32_t>(name) }
constexpr Constant kConstants[] = {
    BOCST_NAMED(kAll),
    BOCST_NAMED(kGrey),
    BOCST_NAMED(kBoxOnly),
    BOCST_NAMED(kCounts),
    BOCST_NAMED(kNext),
    BOCST_NAMED(kIds),
    BOCST_NAMED(kOctants),
    BOCST_NAMED(kBox),
    BOCST_NAMED(kTensor),
    BOCST_NAMED(kNormal),
    BOCST_NAMED(kSlab),
    BOCST_NAMED(kOctantWords),
    BOCST_NAMED(kStateWords),
    BOCST_NAMED(kSlabShift),
    BOCST_NAMED(kSlabScale),
    BOCST_NAMED(kLoBytes),
    BOCST_NAMED(kHiBytes),
    BOCST_NAMED(kNormalBytes),
    BOCST_NAMED(kSlabCenterBytes),
    BOCST_NAMED(kSlabHalfBytes),
    BOCST_NAMED(kOwnLoBytes),
    BOCST_NAMED(kOwnHiBytes),
    BOCST_NAMED(kOwnSlabHalfBytes),
    BOCST_NAMED(kGreyBytes),
    BOCST_NAMED(kListWords),
    BOCST_NAMED(kIdWords),
    BOCST_NAMED(kFailed),
    BOCST_NAMED(kGroups),
    BOCST_NAMED(kHeader),
    BOCST_NAMED(kBoundsWords),
    BOCST_NAMED(kRowSizes),
    BOCST_NAMED(kRowList),
    BOCST_NAMED(kRowIds),
    BOCST_NAMED(kRowSum),
    BOCST_NAMED(kRowCheck),
    BOCST_NAMED(kRow),
    BOCST_NAMED(kMasksFailed),
    BOCST_NAMED(kListsFailed),
    BOCST_NAMED(kCheckFactor),
    BOCST_NAMED(kBoxSteps),
    BOCST_NAMED(kNormalLength),
    BOCST_NAMED(kMostNormalNorm1),
    BOCST_NAMED(kMostSlabCenter),
    BOCST_NAMED(kMostSlabHalf),
    BOCST_NAMED(kPairRotation),
    BOCST_NAMED(kPairShift),
    BOCST_NAMED(kPairUnit),
    BOCST_NAMED(kPairMargin),
    BOCST_NAMED(kPairTolerance),
    BOCST_NAMED(kPairNotSmaller),
    BOCST_NAMED(kPairTrees),
    BOCST_NAMED(kTreeBegin),
    BOCST_NAMED(kTreeStamp),
    BOCST_NAMED(kTreeUsed),
    BOCST_NAMED(kTreeWanted),
    BOCST_NAMED(kTreeBlocks),
    BOCST_NAMED(kTreeRoot),
    BOCST_NAMED(kTreeDeepest),
    BOCST_NAMED(kTreeExtent),
    BOCST_NAMED(kTreeWords),
    BOCST_NAMED(kPairBatch),
    BOCST_NAMED(kPairWords),
    BOCST_NAMED(kPairAnswer),
    BOCST_NAMED(kWalkGroup),
    BOCST_NAMED(kWalkPairs),
    BOCST_NAMED(kDeferredRoom),
    BOCST_NAMED(kMostWanted),
    BOCST_NAMED(kMostSteps),
    BOCST_NAMED(kWalkStack),
    {"kMostLevel", lattice::kMaxLevel},
    {"kNodePlace", node_table::kPlace},
    {"kNodeShape", node_table::kShape},
    {"kNodeChildren", node_table::kChildren},
    {"kNodeStamp", node_table::kStamp},
    {"kNodeWords", node_table::kWords},
    {"kNoBlock", node_table::kNone},
    {"kMeet", DeviceWalks::kMeet},
    {"kDoubt", DeviceWalks::kDoubt},
    {"kGrows", DeviceWalks::kGrows},
    {"kUndone", DeviceWalks::kUndone},
    {"kInvalid", DeviceWalks::kInvalid},
};
#undef BOCST_NAMED

}  // namespace

std::string constants() {
  // A layout qualifier takes a literal, so a macro.
  std::string text =
      "#define GROUP " + std::to_string(kGroup) + "\n#define WALK_GROUP " + std::to_string(kWalkGroup) + "\n";
  for (const Constant& c : kConstants) {
    text += std::string("const uint ") + c.name + " = " + std::to_string(c.value) + "u;\n";
  }
  text += "const int kMiddle = " + std::to_string(lattice::kMiddle) + ";\n";
  return text;
}

}  // namespace bocst::oracle::gl::layout
