// A segment as a rectangle of u_pixels in width that looks at the eye; a point as a square of twice that.
layout(location = 1) in vec3 from;
layout(location = 2) in vec3 to;
uniform vec3 u_scale;
uniform vec2 u_pixel;  // in clip coordinates
uniform float u_pixels;

void main() {
  vec2 a = from.xy * u_scale.xy / u_pixel, b = to.xy * u_scale.xy / u_pixel;
  vec2 along = b - a;
  float size = length(along);
  along = size > 0.0 ? along / size : vec2(1.0, 0.0);
  float width = size > 0.0 ? u_pixels : 2.0 * u_pixels;
  bool at_end = (gl_VertexID & 1) != 0;
  vec2 side = vec2(-along.y, along.x) * ((gl_VertexID & 2) != 0 ? 0.5 : -0.5) * width;
  vec2 corner = (at_end ? b + 0.5 * width * along : a - 0.5 * width * along) + side;
  gl_Position = vec4(corner * u_pixel, (at_end ? to.z : from.z) * u_scale.z, 1.0);
}
