uniform vec3 u_color;
out vec4 result;

void main() {
  result = vec4(u_color * 0.75, 1.0);
}
