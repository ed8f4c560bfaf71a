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
  // The rim is less transparent, so that spheres are told apart.
  float rim = pow(1.0 - n.z, 2.0);
  float opacity = u_opacity < 1.0 ? mix(u_opacity, 1.0, 0.5 * rim) : 1.0;
  result = vec4(mix(u_color, lit(u_color, n), 0.7) * (1.0 - 0.4 * rim), opacity);
}
