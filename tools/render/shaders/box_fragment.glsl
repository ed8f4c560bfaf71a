in vec3 p;
in vec3 at;
uniform vec3 u_color;
uniform float u_opacity;
uniform float u_pixels;
out vec4 result;

void main() {
  // Of the two coordinates that vary over this face: how many pixels from an edge.
  vec3 change = fwidth(at);
  vec3 away = mix((1.0 - abs(at)) / max(change, 1e-9), vec3(1e9), lessThan(change, vec3(1e-6)));
  // Edges of boxes that are a few pixels wide would be all that is seen.
  vec3 width = mix(2.0 / max(change, 1e-9), vec3(1e9), lessThan(change, vec3(1e-6)));
  float drawn = smoothstep(1.0, 3.5, min(width.x, min(width.y, width.z)) / u_pixels);
  float edge = min(away.x, min(away.y, away.z)) < 0.5 * u_pixels ? drawn : 0.0;
  vec3 color = mix(u_color, lit(u_color, cross(dFdx(p), dFdy(p))), 0.7);
  result = vec4(color * (1.0 - 0.55 * edge), min(1.0, u_opacity + 0.3 * edge));
}
