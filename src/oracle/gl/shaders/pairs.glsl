// The walk over pairs of sphere-trees (query/collide/sphere_steps.h): a work group a pair of trees at a pose, eight
// pairs of nodes at a time, a lane for each octant of the node that is expanded. It ends at the first leaves whose
// spheres surely meet.
//
// The stack is sorted by depth, the sum of the two levels: what is taken are its deepest pairs, and what they put back
// is deeper by one. It seldom holds more than 200 pairs, and a larger one would leave room for fewer groups at a time; a
// walk that needs more room is left undone, for the host.
//
// A walk that has come to many nodes that are not resident ends, too: it will be walked again when those among them that
// overlap most are there, and the resident nodes tell little before.

layout(local_size_x = WALK_GROUP) in;

layout(std430, binding = 0) readonly buffer Nodes { uint nodes[]; };  // tables of trees
layout(std430, binding = 1) readonly buffer Pairs { uint pairs[]; };
layout(std430, binding = 2) buffer Answers { uint answers[]; };

shared uvec2 s_stack[kWalkStack];
shared uint s_depth, s_found, s_goes_on[2];
shared uvec2 s_deferred[kDeferredRoom];
shared float s_gap[kDeferredRoom];
shared uint s_deferred_count;
shared uint s_pair[kPairWords], s_check;

uint word(uint at) { return s_pair[at]; }
float number(uint at) { return uintBitsToFloat(word(at)); }
uint ofTree(int t, uint at) { return word(kPairTrees + uint(t) * kTreeWords + at); }

const uint kRoot = 0xffffffffu;  // as NodeRef

struct Node {
  uint level;
  ivec3 at;  // of its cell
};

uint blockWord(int t, uint block, uint at) { return nodes[ofTree(t, kTreeBegin) + block * kNodeWords + at]; }

Node nodeOf(int t, uint name) {
  if (name == kRoot) return Node(1u, ivec3(0));
  uint place = blockWord(t, name >> 3, kNodePlace), shape = blockWord(t, name >> 3, kNodeShape);
  ivec3 octant = ivec3(name, name >> 1, name >> 2) & 1;
  return Node((shape >> 16 & 0xffu) + 1u, 2 * ivec3(place & 0xffffu, place >> 16, shape & 0xffffu) + octant);
}

// About the middle of its own root, in units of tree 0; as TreeSide::sphere().
void sphereOf(int t, Node node, out vec3 center, out float radius) {
  int side = 1 << (kMostLevel - node.level);
  ivec3 end = ivec3(ofTree(t, kTreeExtent), ofTree(t, kTreeExtent + 1u), ofTree(t, kTreeExtent + 2u)) - kMiddle;
  ivec3 low = node.at * side - kMiddle, high = min(low + side, end);
  float half_unit = t == 0 ? 0.5 : 0.5 * number(kPairUnit);
  center = vec3(low + high) * half_unit;
  if (all(greaterThanEqual(end, low + side))) {
    radius = float(2 * side) * half_unit * 0.8660254;
    return;
  }
  vec3 extent = vec3(high - low);
  radius = sqrt(dot(extent, extent)) * half_unit * (node.level < ofTree(t, kTreeDeepest) ? 1.4142136 : 1.0);
}

vec3 placed(vec3 p) {
  const uint r = kPairRotation, s = kPairShift;
  return vec3(number(s), number(s + 1u), number(s + 2u)) + vec3(number(r), number(r + 3u), number(r + 6u)) * p.x +
         vec3(number(r + 1u), number(r + 4u), number(r + 7u)) * p.y +
         vec3(number(r + 2u), number(r + 5u), number(r + 8u)) * p.z;
}

void found(uint what) { atomicOr(s_found, what); }

// The way from one node's sphere to the other's, in units of tree 0, and their radii.
void spheresOf(Node node[2], out vec3 way, out float radius[2]) {
  vec3 center[2];
  sphereOf(0, node[0], center[0], radius[0]);
  sphereOf(1, node[1], center[1], radius[1]);
  way = placed(center[1]) - center[0];
}

// What overlaps most has the least, as in DeferredPairs.
float gapOf(Node node[2]) {
  vec3 way;
  float radius[2];
  spheresOf(node, way, radius);
  return dot(way, way) / (radius[0] * radius[0] + radius[1] * radius[1]);
}

void defer(uvec2 names, Node node[2]) {
  found(kGrows);
  uint i = atomicAdd(s_deferred_count, 1u);
  s_deferred[i] = names;
  s_gap[i] = gapOf(node);
}

void markUsed(int t, uint block) {
  uint at = ofTree(t, kTreeUsed) + block / 32u, bit = 1u << (block & 31u);
  if ((answers[at] & bit) == 0u) atomicOr(answers[at], bit);
}

uint blockOf(int t, uint name) {
  return name == kRoot ? ofTree(t, kTreeRoot) : blockWord(t, name >> 3, kNodeChildren + (name & 7u));
}

// True if the walk goes on with this octant of the node that is expanded; `next` is then the pair with it.
bool step(uvec2 names, uint octant, out uvec2 next) {
  Node node[2] = Node[2](nodeOf(0, names.x), nodeOf(1, names.y));
  bool leaf0 = node[0].level >= ofTree(0, kTreeDeepest), leaf1 = node[1].level >= ofTree(1, kTreeDeepest);
  int deeper = int(node[1].level) - int(node[0].level);
  int x = leaf1 || (!leaf0 && deeper >= int(word(kPairNotSmaller))) ? 0 : 1;
  uint name = x == 0 ? names.x : names.y;
  uint block = blockOf(x, name);
  if (block == kNoBlock) {
    if (octant == 0u) defer(names, node);
    return false;
  }
  if (block >= ofTree(x, kTreeBlocks) || blockWord(x, block, kNodeStamp) != ofTree(x, kTreeStamp)) {
    found(kInvalid);
    return false;
  }
  if (octant == 0u) markUsed(x, block);
  if ((blockWord(x, block, kNodeShape) >> (24u + octant) & 1u) == 0u) return false;
  uint child = block << 3 | octant;
  next = x == 0 ? uvec2(child, names.y) : uvec2(names.x, child);
  node[x] = nodeOf(x, child);
  vec3 way;
  float radius[2];
  spheresOf(node, way, radius);
  float squared = dot(way, way), margin = number(kPairMargin);
  float limit = radius[0] + radius[1] + number(kPairTolerance), most = limit + margin, least = max(limit - margin, 0.0);
  if (squared > most * most) return false;
  bool are_leaves = (x == 0 ? leaf1 : leaf0) && node[x].level >= ofTree(x, kTreeDeepest);
  if (are_leaves) found(squared < least * least ? kMeet : kDoubt);
  return !are_leaves;
}

uint before(uint lane) {
  uint low = s_goes_on[0], high = s_goes_on[1];
  if (lane < 32u) return uint(bitCount(low & ((1u << lane) - 1u)));
  return uint(bitCount(low) + bitCount(high & ((1u << (lane - 32u)) - 1u)));
}

void synchronise() {
  memoryBarrierShared();
  barrier();
}

bool isBefore(uvec2 names, uvec2 others) {
  return names.x < others.x || (names.x == others.x && names.y < others.y);
}

// Puts the deferred pairs that overlap most first; of equal ones, which come in any order, those of lesser names.
void sortDeferred(uint lane) {
  uint count = s_deferred_count, rank = 0u;
  uvec2 names = s_deferred[lane];
  float gap = s_gap[lane];
  for (uint i = 0u; i < count; ++i) {
    if (s_gap[i] < gap || (s_gap[i] == gap && isBefore(s_deferred[i], names))) ++rank;
  }
  synchronise();
  if (lane < count) s_deferred[rank] = names;
  synchronise();
}

void wantNode(int t, uint name) {
  bool is_root = name == kRoot;
  if (blockOf(t, name) != kNoBlock || nodeOf(t, name).level >= ofTree(t, kTreeDeepest)) return;
  uint block = is_root ? ofTree(t, kTreeBlocks) : name >> 3, octant = is_root ? 0u : name & 7u;
  uint at = ofTree(t, kTreeWanted) + block / 4u, bit = 1u << ((block & 3u) * 8u + octant);
  if ((answers[at] & bit) == 0u) atomicOr(answers[at], bit);
}

// What is asked, and the check of it: each word times a power of kCheckFactor.
void readPair(uint pair, uint lane) {
  if (lane == 0u) s_check = 0u;
  synchronise();
  for (uint i = lane; i < kPairWords; i += kWalkGroup) {
    uint factor = 1u;
    for (uint k = i + 1u; k < kPairWords; ++k) factor *= kCheckFactor;
    s_pair[i] = pairs[pair * kPairWords + i];
    atomicAdd(s_check, s_pair[i] * factor);
  }
}

void main() {
  uint pair = gl_WorkGroupID.x, lane = gl_LocalInvocationIndex;
  readPair(pair, lane);
  if (lane == 0u) {
    s_stack[0] = uvec2(kRoot);
    s_depth = 1u;
    s_found = 0u;
    s_deferred_count = 0u;
  }
  uint depth, steps = 0u;
  for (;;) {
    synchronise();
    depth = s_depth;
    bool is_done = depth == 0u || (s_found & (kMeet | kInvalid)) != 0u || steps == kMostSteps;
    synchronise();
    if (is_done) break;
    ++steps;
    if (lane < 2u) s_goes_on[lane] = 0u;
    synchronise();
    uint taken = min(depth, kWalkPairs), entry = lane / 8u;
    uvec2 next;
    bool goes_on = entry < taken && step(s_stack[depth - taken + entry], lane & 7u, next);
    if (goes_on) atomicOr(s_goes_on[lane / 32u], 1u << (lane & 31u));
    synchronise();
    uint after = depth - taken + uint(bitCount(s_goes_on[0]) + bitCount(s_goes_on[1]));
    if (after > kWalkStack) break;
    if (goes_on) s_stack[depth - taken + before(lane)] = next;
    if (lane == 0u) s_depth = after;
    if (s_deferred_count > kDeferredRoom - kWalkPairs) break;
  }
  if ((s_found & (kGrows | kMeet)) == kGrows) {
    sortDeferred(lane);
    if (lane < min(s_deferred_count, kMostWanted)) {
      wantNode(0, s_deferred[lane].x);
      wantNode(1, s_deferred[lane].y);
    }
  }
  if (lane != 0u) return;
  uint row = pair * kPairAnswer;
  answers[row] = word(kPairBatch) << 8 | s_found | (depth != 0u && (s_found & kMeet) == 0u ? kUndone : 0u);
  answers[row + 1u] = s_check;
}
