in vec2 corner;
flat in vec4 sphere;
uniform vec3 u_scale;
uniform vec3 u_color;
uniform float u_opacity;
out vec4 result;

void main() {
  float square = dot(corner, corner);
  if (square > 1.0) discard;
  vec3 n = vec3(corner, sqrt(1.0 - square));
  gl_FragDepth = 0.5 + 0.5 * (sphere.z + sphere.w * n.z) * u_scale.z;
  float rim = pow(1.0 - n.z, 2.0);
  result = vec4(lit(u_color, n) * (1.0 - 0.35 * rim), mix(u_opacity, 1.0, 0.5 * rim * (u_opacity < 1.0 ? 1.0 : 0.0)));
}
