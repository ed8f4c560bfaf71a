// Daylight from above and a lamp at the left of the eye. Both sides of a triangle are outside.
vec3 lit(vec3 color, vec3 normal) {
  float size = length(normal);
  vec3 n = size > 0.0 ? normal / size : vec3(0.0, 0.0, 1.0);
  if (n.z < 0.0) n = -n;
  float sky = 0.5 + 0.5 * n.y;
  float lamp = max(dot(n, normalize(vec3(-0.45, 0.55, 0.8))), 0.0);
  float rim = pow(1.0 - n.z, 3.0);
  return color * (0.34 + 0.16 * sky + 0.58 * lamp) * (1.0 - 0.25 * rim);
}
