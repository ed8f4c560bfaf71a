in vec3 p;
uniform vec3 u_color;
uniform float u_opacity;
out vec4 result;

void main() {
  result = vec4(lit(u_color, cross(dFdx(p), dFdy(p))), u_opacity);
}
