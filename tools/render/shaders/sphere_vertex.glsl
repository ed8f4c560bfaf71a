layout(location = 1) in vec3 center;
layout(location = 3) in float radius;
uniform vec3 u_scale;
out vec2 corner;
flat out vec4 sphere;

void main() {
  corner = vec2((gl_VertexID & 1) != 0 ? 1.0 : -1.0, (gl_VertexID & 2) != 0 ? 1.0 : -1.0);
  sphere = vec4(center, radius);
  gl_Position = vec4(center * u_scale, 1.0);
  gl_Position.xy += corner * radius * u_scale.xy;
}
