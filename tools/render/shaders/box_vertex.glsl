layout(location = 0) in vec3 corner;
layout(location = 1) in vec3 center;
layout(location = 2) in vec3 extent;
uniform vec3 u_scale;
uniform mat3 u_axes;
out vec3 p;
out vec3 at;

void main() {
  at = corner;
  p = center + u_axes * (corner * extent);
  gl_Position = vec4(p * u_scale, 1.0);
}
