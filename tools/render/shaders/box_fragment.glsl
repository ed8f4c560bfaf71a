in vec3 p;
in vec3 at;
uniform vec3 u_color;
uniform float u_opacity;
uniform float u_pixels;
out vec4 result;

void main() {
  // Of the two coordinates that vary over this face: how many pixels from an edge?
  vec3 change = fwidth(at);
  vec3 away = mix((1.0 - abs(at)) / max(change, 1e-9), vec3(1e9), lessThan(change, vec3(1e-6)));
  bool edge = min(away.x, min(away.y, away.z)) < 0.5 * u_pixels;
  vec3 color = mix(u_color, lit(u_color, cross(dFdx(p), dFdy(p))), 0.7);
  result = edge ? vec4(color * 0.45, min(1.0, u_opacity + 0.3)) : vec4(color, u_opacity);
}
