uniform vec3 u_color;
uniform float u_opacity;
out vec4 result;

void main() {
  result = vec4(u_color * 0.75, u_opacity);
}
