// What the passes of the compute oracle share: the tables they read and write, and how a pair finds its cell.
//
// A *pair* is a triangle and a cell to expand whose list it is on. Pairs are numbered through the whole batch, cell by
// cell; an invocation works on one pair, so lanes stay busy however short the lists are.
//
// The constants of the tables (States, Answers) and of the bytes of bounds stand before this text: see oracle/gl/layout.h.

layout(local_size_x = GROUP) in;

struct Cell {
  vec3 center;      // in lattice units
  float half_side;
  uint first_pair;
  uint list;        // where its list begins in `lists`, or kAll
  uint exists;      // octants that have an actual region
  uint ids_up_to;   // longer lists are not wanted by the host
};

const uint kSlabTriangles = 4096u;  // longer lists belong to cells whose slabs cull nothing

layout(std430, binding = 0) readonly buffer Vertices { float vertices[]; };  // 3 x high, 3 x low part
layout(std430, binding = 1) readonly buffer Indices { uint indices[]; };
layout(std430, binding = 2) buffer Lists { uint lists[]; };
layout(std430, binding = 3) readonly buffer Cells { Cell cells[]; };
layout(std430, binding = 4) buffer States { uint states[]; };
layout(std430, binding = 5) buffer Masks { uint masks[]; };
layout(std430, binding = 6) buffer Answers { uint answers[]; };
layout(std430, binding = 7) readonly buffer Exact { double exact[]; };  // vertices in lattice units

uniform uvec2 u_pairs;      // first and end of the pairs of this surface
uniform uvec2 u_cells;      // first and end of its cells
uniform uint u_cell_count;  // of the batch
uniform uvec2 u_list_capacity;  // first word and number of words
uniform uint u_id_capacity;

uint invocation() {
  return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * GROUP + gl_LocalInvocationIndex;
}

uint cellOf(uint pair) {
  uint lo = u_cells.x, hi = u_cells.y;  // cells[lo].first_pair <= pair < cells[hi].first_pair
  while (hi - lo > 1u) {
    uint middle = (lo + hi) / 2u;
    if (cells[middle].first_pair <= pair) lo = middle; else hi = middle;
  }
  return lo;
}

uint triangleOf(uint cell, uint pair) {
  uint i = pair - cells[cell].first_pair;
  return cells[cell].list == kAll ? i : lists[cells[cell].list + i];
}

uint state(uint cell, uint word) { return cell * kStateWords + word; }
uint octantState(uint cell, int octant, uint word) {
  return state(cell, kOctants + uint(octant) * kOctantWords + word);
}

// Did a list or the ids not find room? Then the host makes room and starts over from the placing of the lists.
bool isOverflown() { return answers[kListWords] > u_list_capacity.y || answers[kIdWords] > u_id_capacity; }

uint sizeOf(uint cell, int octant) { return states[state(cell, kCounts + uint(octant))]; }

// Corners in the cell's own coordinates, centre 0 and half side 1: two roundings at most, as the rounding margins expect.
void cornersOf(uint cell, uint triangle, out vec3 v[3]) {
  float inverse = 1.0 / cells[cell].half_side;  // a power of two
  for (int k = 0; k < 3; ++k) {
    uint at = 6u * indices[3u * triangle + uint(k)];
    vec3 high = vec3(vertices[at], vertices[at + 1u], vertices[at + 2u]);
    vec3 low = vec3(vertices[at + 3u], vertices[at + 4u], vertices[at + 5u]);
    v[k] = ((high - cells[cell].center) + low) * inverse;
  }
}

vec3 octantCenter(int o) { return vec3((o & 1) != 0, (o & 2) != 0, (o & 4) != 0) - 0.5; }

const float kUlp = 1.0 / 16777216.0;  // 2^-24
