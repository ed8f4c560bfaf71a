// A corner in the octant's own coordinates: centre 0, half side 1.

layout(location = 0) in vec3 high;
layout(location = 1) in vec3 low;
uniform vec3 u_center;
uniform float u_inverse_half;
uniform int u_axis;  // of the sampled form: the axis to look along

out vec3 corner;

void main() {
  // In another order the sum is off by what the lattice's coordinates round, not the octant's.
  PRECISE vec3 from = high - u_center;
  PRECISE vec3 exact = from + low;
  corner = exact * u_inverse_half;
  // The orthographic volume is the octant.
  gl_Position = vec4(corner[(u_axis + 1) % 3], corner[(u_axis + 2) % 3], corner[u_axis], 1.0);
}
