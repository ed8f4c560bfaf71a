in vec3 p;
uniform vec3 u_color;
out vec4 result;

void main() {
  result = vec4(lit(u_color, cross(dFdx(p), dFdy(p))), 1.0);
}
