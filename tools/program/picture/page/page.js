'use strict';
(() => {
const byId = (id) => document.getElementById(id);
const scene = JSON.parse(byId('scene').textContent);

function decoded(text, Type) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Type(bytes.buffer);
}

// 4x4 matrices by columns, in double, so that only what is near the origin reaches the GPU's floats.
const matrix = {
  product(a, b) {
    const c = new Float64Array(16);
    for (let i = 0; i < 4; ++i) {
      for (let j = 0; j < 4; ++j) {
        for (let k = 0; k < 4; ++k) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
      }
    }
    return c;
  },
  scaled(s) { return [s, 0, 0, 0, 0, s, 0, 0, 0, 0, s, 0, 0, 0, 0, 1]; },
  moved(t) { return [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, t[0], t[1], t[2], 1]; },
  perspective(angle, aspect, near, far) {
    const f = 1 / Math.tan(angle / 2);
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far),
      0];
  },
  applied(m, p) {
    return [0, 1, 2].map((i) => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]);
  },
};

// Positions of an object are in [-1/2, 1/2]; this is the way to the page's frame, then to the unit ball about the scene.
function place(object, pose) {
  object.pose = pose;
  object.toPage = matrix.product(pose, matrix.product(matrix.moved(object.center), matrix.scaled(object.size)));
}
for (const object of scene.objects) {
  place(object, object.pose);
  object.positions = decoded(object.positions, Uint16Array);
  object.indices = decoded(object.indices, Uint32Array);
  for (const tree of object.trees) {
    tree.numbers = decoded(tree.numbers, Float32Array);
    tree.level_of = decoded(tree.level_of, Uint8Array);
    tree.is_leaf = decoded(tree.is_leaf, Uint8Array);
  }
}
const states = scene.states ? scene.states.list : [];
const movers = scene.states ? scene.states.moving.map((o) => scene.objects[o]) : [];
for (const state of states) state.poses = decoded(state.poses, Float64Array);
const moveTo = (state) => movers.forEach((object, i) => place(object, state.poses.subarray(16 * i, 16 * i + 16)));
/** Position, normal from A to B, depth, in the page's frame; the triangles (or cells) of A and B. */
const contacts = [];
if (scene.contacts) {
  const list = decoded(scene.contacts.numbers, Float64Array);
  for (let i = 0; i < list.length; i += 9) {
    contacts.push({position: list.subarray(i, i + 3), normal: list.subarray(i + 3, i + 6), depth: list[i + 6],
      a: list[i + 7], b: list[i + 8]});
  }
}
let chosenContact = -1;

function boxCornersOf(object) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => matrix.applied(object.toPage, [i & 1, i >> 1 & 1, i >> 2].map((x) => x - 0.5)));
}

/** About all objects, or about what moves, in all states. */
function ballOfScene() {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const extend = (object) => boxCornersOf(object).forEach((p) => p.forEach((x, k) => {
    low[k] = Math.min(low[k], x);
    high[k] = Math.max(high[k], x);
  }));
  if (states.length === 0) scene.objects.forEach(extend);
  for (const state of states) {
    moveTo(state);
    movers.forEach(extend);
  }
  const size = high.map((x, k) => x - low[k]);
  return {center: low.map((x, k) => (x + high[k]) / 2), radius: Math.hypot(...size) / 2 || 1};
}
const ball = ballOfScene();
// How far objects reach from its middle, in its radius.
const reach = Math.max(...scene.objects.flatMap(boxCornersOf).map((p) => Math.hypot(...p.map((x, k) => x - ball.center[k])))) /
  ball.radius;
const toBall = matrix.product(matrix.scaled(1 / ball.radius), matrix.moved(ball.center.map((x) => -x)));

// ---- what is chosen

const kinds = [...new Set(scene.objects.flatMap((object) => object.trees.map((tree) => tree.name)))];
const chosen = {get tree() { return byId('tree').value; }, get volume() { return byId('volume').value; },
  get cut() { return byId('cut').value; }, get level() { return Number(byId('level').value); },
  shown: scene.objects.map(() => true),
  get opacity() { return Number(byId('opacity').value); }, get state() { return Number(byId('state').value); }};
const treesShown = () => scene.objects.map((object) => object.trees.find((tree) => tree.name === chosen.tree));
const number = (x) => x.toLocaleString('en');

/** The nodes to draw: indices into the tree's arrays. */
function nodesToDraw(tree) {
  const nodes = [];
  for (let i = 0; i < tree.level_of.length; ++i) {
    const level = tree.level_of[i];
    if (level === chosen.level || (chosen.cut === 'leaves' && level < chosen.level && tree.is_leaf[i])) nodes.push(i);
  }
  return nodes;
}

// ---- drawing

const shaders = {
  mesh: [`
    layout(location = 0) in vec3 position;
    uniform mat4 toEye, projection;
    out vec3 p;
    void main() { vec4 e = toEye * vec4(position - 0.5, 1); p = e.xyz; gl_Position = projection * e; }`, `
    in vec3 p;
    uniform vec4 color;
    out vec4 result;
    void main() {
      vec3 n = normalize(cross(dFdx(p), dFdy(p)));
      float light = 0.35 + 0.65 * abs(dot(n, normalize(vec3(0.3, 0.5, 1))));
      result = vec4(color.rgb * light, color.a);
    }`],
  spheres: [`
    layout(location = 0) in vec2 corner;
    layout(location = 1) in vec3 center;
    layout(location = 3) in float radius;
    uniform mat4 toEye, projection;
    uniform float scale;
    out vec3 p;
    flat out vec4 sphere;
    void main() {
      vec3 c = (toEye * vec4(center, 1)).xyz;
      float r = radius * scale, d = length(c);
      vec3 way = d > 0.0 ? c / d : vec3(0, 0, -1);
      vec3 side = normalize(cross(way, abs(way.y) < 0.9 ? vec3(0, 1, 0) : vec3(1, 0, 0)));
      // As far as the cone from the eye about the sphere reaches in the plane through the centre.
      float reach = d > r * 1.0001 ? r * d / sqrt(d * d - r * r) : r * 100.0;
      p = c + reach * (corner.x * side + corner.y * cross(side, way));
      sphere = vec4(c, r);
      gl_Position = projection * vec4(p, 1);
    }`, `
    in vec3 p;
    flat in vec4 sphere;
    uniform mat4 projection;
    uniform float near;
    uniform vec4 color;
    out vec4 result;
    void main() {
      vec3 way = normalize(p), c = sphere.xyz;
      float along = dot(way, c);
      float aside = dot(c - along * way, c - along * way), inside = sphere.w * sphere.w - aside;
      if (inside < 0.0) discard;
      vec3 hit = (along - sqrt(inside)) * way;
      if (hit.z > -near) discard;
      vec4 clip = projection * vec4(hit, 1);
      gl_FragDepth = clip.z / clip.w * 0.5 + 0.5;
      vec3 n = (hit - c) / sphere.w;
      float rim = 1.0 - abs(dot(n, way));
      result = vec4(color.rgb * (1.0 - 0.65 * rim * rim), color.a);
    }`],
  boxes: [`
    layout(location = 0) in vec3 corner;
    layout(location = 1) in vec3 center;
    layout(location = 2) in vec3 extent;
    uniform mat4 toEye, projection;
    out vec3 p;
    void main() {
      vec4 e = toEye * vec4(center + corner * extent, 1);
      p = e.xyz;
      gl_Position = projection * e;
    }`, `
    in vec3 p;
    uniform vec4 color;
    uniform float shading;
    out vec4 result;
    void main() {
      vec3 n = normalize(cross(dFdx(p), dFdy(p)));
      result = vec4(color.rgb * mix(1.0, 0.5 + 0.5 * abs(n.z), shading), color.a);
    }`],
  wires: [`
    layout(location = 0) in vec3 position;
    uniform mat4 toEye, projection;
    void main() { gl_Position = projection * toEye * vec4(position - 0.5, 1); }`, `
    uniform vec4 color;
    out vec4 result;
    void main() { result = color; }`],
  marks: [`
    layout(location = 0) in vec3 position;
    uniform mat4 toEye, projection;
    uniform float size;
    void main() { gl_Position = projection * toEye * vec4(position, 1); gl_PointSize = size; }`, `
    uniform vec4 color;
    out vec4 result;
    void main() { result = color; }`],
};

const canvas = byId('view');
const gl = canvas.getContext('webgl2', {alpha: false, antialias: true});
// It looks at `focus`, in the unit ball about the scene, from `distance`; `aim` is what was moved aside, in the image's plane.
const camera = {turn: 0.7, tilt: 0.45, distance: 2.5, aim: [0, 0], focus: [0, 0, 0], angle: 0.8};
const objectColors = [[0.62, 0.68, 0.74], [0.80, 0.70, 0.56]];
const touchColor = [0.87, 0.27, 0.20];
/** Of two meshes one after the other; in a scene what moves and what does not. */
function colorOf(object, o) {
  if (states.length === 0) return objectColors[o % 2];
  if (states[chosen.state].contacts.some((pair) => pair.includes(o))) return touchColor;
  return objectColors[movers.includes(object) ? 0 : 1];
}
const volumeColors = [[0.16, 0.47, 0.84], [0.90, 0.47, 0.13]];
const pointColor = [0.85, 0.0, 0.25], normalColor = [0.55, 0.05, 0.35], faultColor = [0.85, 0.0, 0.1];
const isShown = (object, o) => chosen.shown[o] && (states.length === 0 || byId('fixed').checked || movers.includes(object));
const decodedFaults = (object) => object.faults ? decoded(object.faults, Float64Array) : new Float64Array();
let faulty, programs, meshes, corners, instances, marks;

function program([vertex, fragment]) {
  const linked = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, '#version 300 es\nprecision highp float;\n' + text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(linked, shader);
  }
  gl.linkProgram(linked);
  if (!gl.getProgramParameter(linked, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(linked));
  return {linked, at: (name) => gl.getUniformLocation(linked, name)};
}

function buffer(data, target = gl.ARRAY_BUFFER) {
  const made = gl.createBuffer();
  gl.bindBuffer(target, made);
  gl.bufferData(target, data, gl.STATIC_DRAW);
  return made;
}

/** A vertex array; each attribute is [location, buffer, size, type, normalised, stride, offset, divisor]. */
function vertexArray(attributes, indices) {
  const made = gl.createVertexArray();
  gl.bindVertexArray(made);
  for (const [at, data, size, type, normalised, stride, offset, divisor] of attributes) {
    gl.bindBuffer(gl.ARRAY_BUFFER, data);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, type, normalised, stride, offset);
    gl.vertexAttribDivisor(at, divisor);
  }
  if (indices) gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
  gl.bindVertexArray(null);
  return made;
}

const boxCorners = new Float32Array([0, 1, 2, 3, 4, 5, 6, 7].flatMap((i) => [i & 1, i >> 1 & 1, i >> 2].map((x) => 2 * x - 1)));
const boxFaces = new Uint16Array([0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6,
  1, 3, 5, 3, 7, 5]);
const boxEdges = new Uint16Array([0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 1, 3, 4, 6, 5, 7, 0, 4, 1, 5, 2, 6, 3, 7]);

function prepare() {
  programs = Object.fromEntries(Object.entries(shaders).map(([name, text]) => [name, program(text)]));
  meshes = scene.objects.map((object) => ({
    array: vertexArray([[0, buffer(object.positions), 3, gl.UNSIGNED_SHORT, true, 0, 0, 0]],
      buffer(object.indices, gl.ELEMENT_ARRAY_BUFFER)),
    count: object.indices.length, wires: null}));
  corners = {quad: buffer(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1])), box: buffer(boxCorners),
    faces: buffer(boxFaces, gl.ELEMENT_ARRAY_BUFFER), edges: buffer(boxEdges, gl.ELEMENT_ARRAY_BUFFER)};
  instances = scene.objects.map(() => {
    const data = gl.createBuffer();
    const node = (at, size, offset) => [at, data, size, gl.FLOAT, false, 28, offset, 1];
    const box = [[0, corners.box, 3, gl.FLOAT, false, 0, 0, 0], node(1, 3, 0), node(2, 3, 12)];
    return {data, count: 0, faces: vertexArray(box, corners.faces), edges: vertexArray(box, corners.edges),
      quads: vertexArray([[0, corners.quad, 2, gl.FLOAT, false, 0, 0, 0], node(1, 3, 0), node(3, 1, 24)])};
  });
  const points = [], lines = [];
  for (const contact of contacts) {
    const p = matrix.applied(toBall, contact.position);
    const length = Math.max(0.06, contact.depth / ball.radius);
    points.push(...p);
    lines.push(...p, ...p.map((x, k) => x + length * contact.normal[k]));
  }
  faulty = scene.objects.map((object) => {
    const list = decodedFaults(object), ends = [];
    const toObjectBall = matrix.product(toBall, object.pose);
    for (let i = 0; i < list.length; i += 3) ends.push(...matrix.applied(toObjectBall, list.subarray(i, i + 3)));
    return {count: ends.length / 3, array: vertexArray([[0, buffer(new Float32Array(ends)), 3, gl.FLOAT, false, 0, 0, 0]])};
  });
  marks = [points, lines].map((list) => ({count: list.length / 3,
    array: vertexArray([[0, buffer(new Float32Array(list)), 3, gl.FLOAT, false, 0, 0, 0]])}));
}

function use(name, eye, object) {
  const p = programs[name];
  gl.useProgram(p.linked);
  gl.uniformMatrix4fv(p.at('toEye'), false, new Float32Array(eye));
  gl.uniformMatrix4fv(p.at('projection'), false, new Float32Array(camera.projection));
  if (name === 'spheres') {
    gl.uniform1f(p.at('scale'), object.size / ball.radius);
    gl.uniform1f(p.at('near'), camera.near);
  }
  return p;
}

/** The edges of an object's triangles, made when they are first wanted. */
function wiresOf(o) {
  if (!meshes[o].wires) {
    const {indices} = scene.objects[o], ends = new Uint32Array(2 * indices.length);
    for (let i = 0; i < indices.length; ++i) {
      ends[2 * i] = indices[i];
      ends[2 * i + 1] = indices[i % 3 === 2 ? i - 2 : i + 1];
    }
    meshes[o].wires = vertexArray([[0, buffer(scene.objects[o].positions), 3, gl.UNSIGNED_SHORT, true, 0, 0, 0]],
      buffer(ends, gl.ELEMENT_ARRAY_BUFFER));
  }
  return meshes[o].wires;
}

function drawVolumes(o, eye) {
  const object = scene.objects[o], drawn = instances[o], spheres = chosen.volume === 'spheres';
  if (drawn.count === 0 || chosen.volume === 'none' || !isShown(object, o)) return;
  const p = use(spheres ? 'spheres' : 'boxes', eye, object);
  gl.uniform4f(p.at('color'), ...volumeColors[o % 2], chosen.opacity);
  gl.uniform1f(p.at('shading'), 1);
  gl.bindVertexArray(spheres ? drawn.quads : drawn.faces);
  // Neighbours share faces, of which one looks away; edges and meshes that lie in a face are drawn before it.
  if (!spheres) {
    gl.enable(gl.CULL_FACE);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 2);
  }
  // The nearest surface first, in depth alone; then only that is blended over the mesh, each pixel once.
  for (const depth_only of [true, false]) {
    gl.colorMask(!depth_only, !depth_only, !depth_only, !depth_only);
    gl.depthFunc(depth_only ? gl.LESS : gl.EQUAL);
    if (spheres) gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, drawn.count);
    else gl.drawElementsInstanced(gl.TRIANGLES, 36, gl.UNSIGNED_SHORT, 0, drawn.count);
  }
  gl.depthFunc(gl.LEQUAL);
  if (spheres) return;
  gl.disable(gl.CULL_FACE);
  gl.disable(gl.POLYGON_OFFSET_FILL);
  gl.uniform4f(p.at('color'), ...volumeColors[o % 2].map((x) => x * 0.5), Math.min(1, chosen.opacity + 0.3));
  gl.uniform1f(p.at('shading'), 0);
  gl.bindVertexArray(drawn.edges);
  gl.drawElementsInstanced(gl.LINES, 24, gl.UNSIGNED_SHORT, 0, drawn.count);
}

/** The page's axes as seen: a rotation. */
function turned() {
  const [ct, st, cp, sp] = [Math.cos(camera.turn), Math.sin(camera.turn), Math.cos(camera.tilt), Math.sin(camera.tilt)];
  // z is up: turn about it, then tilt.
  const turn = [-st, -sp * ct, cp * ct, 0, ct, -sp * st, cp * st, 0, 0, cp, sp, 0, 0, 0, 0, 1];
  const stand = byId('up').value === 'y' ? [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1] : matrix.scaled(1);
  return matrix.product(turn, stand);
}

function viewMatrix() {
  const about = matrix.product(turned(), matrix.moved(camera.focus.map((x) => -x)));
  return matrix.product(matrix.moved([...camera.aim, -camera.distance]), about);
}

/** The directions of the axes, and a length of 1, 2 or 5 times a power of ten, which is right at the camera's focus. */
function drawScale() {
  const turn = turned();
  const ends = ['x', 'y', 'z'].map((name, k) => ({name, x: 34 * turn[4 * k], y: -34 * turn[4 * k + 1], z: turn[4 * k + 2],
    color: ['#c22a1f', '#2f8a2b', '#1f56c4'][k]})).sort((a, b) => a.z - b.z);
  byId('axes').replaceChildren(...ends.flatMap(({name, x, y, color}) => [
    element('line', {x1: 0, y1: 0, x2: x, y2: y, stroke: color, 'stroke-width': 2}),
    element('text', {x: 1.22 * x, y: 1.22 * y + 3, 'text-anchor': 'middle', style: `fill: ${color}`}, name)]));
  const pixel = 2 * Math.tan(camera.angle / 2) * camera.distance * ball.radius / Math.max(1, canvas.clientHeight);
  const most = 120 * pixel, power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map((x) => x * power).find((x) => x <= most) || power;
  byId('scale-text').textContent = String(Number(length.toPrecision(2)));
  byId('scale-bar').style.width = `${length / pixel}px`;
}

function draw() {
  if (!gl || gl.isContextLost()) return;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  gl.viewport(0, 0, canvas.width, canvas.height);
  camera.near = Math.min(0.02, 0.1 * camera.distance);
  camera.projection = matrix.perspective(camera.angle, canvas.width / canvas.height, camera.near,
    camera.distance + Math.max(20, reach));
  gl.clearColor(0.957, 0.965, 0.973, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.depthFunc(gl.LEQUAL);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  const view = matrix.product(viewMatrix(), toBall);
  const eyes = scene.objects.map((object) => matrix.product(view, object.toPage));
  scene.objects.forEach((object, o) => {
    if (!isShown(object, o)) return;
    if (byId('mesh').checked) {
      const p = use('mesh', eyes[o], object);
      gl.uniform4f(p.at('color'), ...colorOf(object, o), 1);
      gl.bindVertexArray(meshes[o].array);
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(0.5, 1);
      gl.drawElements(gl.TRIANGLES, meshes[o].count, gl.UNSIGNED_INT, 0);
      gl.disable(gl.POLYGON_OFFSET_FILL);
    }
    if (byId('wires').checked) {
      const p = use('wires', eyes[o], object);
      gl.uniform4f(p.at('color'), ...colorOf(object, o).map((x) => 0.45 * x), 1);
      gl.bindVertexArray(wiresOf(o));
      gl.drawElements(gl.LINES, 2 * meshes[o].count, gl.UNSIGNED_INT, 0);
    }
  });
  scene.objects.forEach((object, o) => drawVolumes(o, eyes[o]));
  gl.disable(gl.DEPTH_TEST);
  if (byId('faults').checked && faulty.some(({count}) => count > 0)) {
    const p = use('marks', viewMatrix());
    gl.uniform4f(p.at('color'), ...faultColor, 1);
    gl.uniform1f(p.at('size'), 5);
    faulty.forEach(({array, count}, o) => {
      if (!isShown(scene.objects[o], o)) return;
      gl.bindVertexArray(array);
      gl.drawArrays(gl.LINES, 0, count);
      gl.drawArrays(gl.POINTS, 0, count);
    });
  }
  if (byId('contacts').checked && marks[0].count > 0) {
    const p = use('marks', viewMatrix());
    gl.uniform1f(p.at('size'), 5);
    marks.forEach(({array, count}, lines) => {
      gl.uniform4f(p.at('color'), ...(lines ? normalColor : pointColor), 1);
      gl.bindVertexArray(array);
      gl.drawArrays(lines ? gl.LINES : gl.POINTS, 0, count);
    });
    if (chosenContact >= 0) {
      gl.uniform1f(p.at('size'), 12);
      gl.uniform4f(p.at('color'), ...pointColor, 1);
      gl.bindVertexArray(marks[0].array);
      gl.drawArrays(gl.POINTS, chosenContact, 1);
    }
  }
  gl.bindVertexArray(null);
  drawScale();
}

let waiting = false;
function drawSoon() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; draw(); });
}

// ---- the panel

function refill() {
  let total = 0;
  treesShown().forEach((tree, o) => {
    const nodes = tree && chosen.shown[o] ? nodesToDraw(tree) : [];
    total += nodes.length;
    if (!gl) return;
    const numbers = new Float32Array(7 * nodes.length);
    nodes.forEach((i, at) => numbers.set(tree.numbers.subarray(7 * i, 7 * i + 7), 7 * at));
    instances[o].count = nodes.length;
    gl.bindBuffer(gl.ARRAY_BUFFER, instances[o].data);
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
  });
  byId('level-shown').textContent = chosen.level;
  byId('count').textContent = number(total) + (total === 1 ? ' node' : ' nodes');
  plot();
  drawSoon();
}

function treeChosen() {
  const levels = Math.max(1, ...treesShown().map((tree) => tree ? tree.levels : 1));
  const level = chosen.level;
  byId('level').max = levels;
  byId('level').value = Math.min(level, levels);
  refill();
}

function stateChosen() {
  const state = states[chosen.state];
  moveTo(state);
  byId('state-shown').textContent = `${chosen.state + 1} of ${number(states.length)} (${state.name})`;
  const room = state.clearance === null ? '' : `, clearance ${state.clearance.toPrecision(4)}`;
  byId('verdict').textContent = state.contacts.length > 0 ? 'collides' : 'free' + room;
  byId('pairs').replaceChildren(...state.contacts.map((pair) => {
    const line = document.createElement('li');
    line.textContent = pair.map((o) => scene.objects[o].name).join(' - ');
    return line;
  }));
  drawSoon();
}

/** From here on, and again from the first. */
function nextCollision() {
  for (let i = 1; i <= states.length; ++i) {
    const at = (chosen.state + i) % states.length;
    if (states[at].contacts.length === 0) continue;
    byId('state').value = at;
    return stateChosen();
  }
}

function element(name, attributes, text) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

function plot() {
  const trees = scene.objects[0].trees.filter((tree) => tree.errors.length > 0);
  byId('plot-row').hidden = scene.objects.length > 1 || trees.length === 0;
  if (byId('plot-row').hidden) return;
  const svg = byId('plot');
  svg.replaceChildren();
  const levels = Math.max(...trees.map((tree) => tree.errors.length));
  const least = Math.min(...trees.flatMap((tree) => tree.errors.map((e) => e[0])).filter((e) => e > 0), 1);
  const bottom = Math.floor(Math.log10(least));
  const x = (level) => 40 + (levels > 1 ? 265 * (level - 1) / (levels - 1) : 130);
  const y = (error) => 10 + 160 * Math.min(1, Math.log10(Math.max(error, 1e-300)) / (bottom || -1));
  for (let decade = 0; decade >= bottom; --decade) {
    svg.append(element('line', {x1: 40, x2: 305, y1: y(10 ** decade), y2: y(10 ** decade), stroke: '#e3e8ec'}),
      element('text', {x: 34, y: y(10 ** decade) + 3, 'text-anchor': 'end'}, decade === 0 ? '1' : `1e${decade}`));
  }
  for (let level = 1; level <= levels; ++level) {
    svg.append(element('text', {x: x(level), y: 188, 'text-anchor': 'middle'}, level));
  }
  svg.append(element('line', {x1: x(chosen.level), x2: x(chosen.level), y1: 8, y2: 172, stroke: '#98a5b0',
    'stroke-dasharray': '3 3'}));
  trees.forEach((tree, t) => {
    const color = tree.name === 'O-BOCST' ? '#c2571a' : '#1f6fc4';
    const shift = 3 * (t - (trees.length - 1) / 2);
    tree.errors.forEach(([min, average, max], i) => {
      svg.append(element('line', {x1: x(i + 1) + shift, x2: x(i + 1) + shift, y1: y(min), y2: y(max), stroke: color,
        'stroke-width': 1.5, opacity: 0.45}),
      element('circle', {cx: x(i + 1) + shift, cy: y(average), r: 2.6, fill: color}));
    });
    svg.append(element('polyline', {points: tree.errors.map((e, i) => `${x(i + 1) + shift},${y(e[1])}`).join(' '),
      fill: 'none', stroke: color, 'stroke-width': tree.name === chosen.tree ? 2 : 1}),
    element('text', {x: 300, y: 20 + 13 * t, 'text-anchor': 'end', style: `fill: ${color}`}, tree.name));
  });
}

function notes() {
  const lines = [];
  for (const object of scene.objects) {
    if (object.shown < object.triangles) {
      lines.push(`${object.name} is shown with ${number(object.shown)} of ${number(object.triangles)} triangles.`);
    }
    for (const tree of object.trees) {
      if (tree.levels < tree.counts.length) {
        lines.push(`${tree.name} of ${object.name}: levels deeper than ${tree.levels} have too many nodes to show.`);
      }
    }
  }
  if (states.length > 0 && scene.states.total > states.length) {
    lines.push(`${number(states.length)} of ${number(scene.states.total)} states are shown.`);
  }
  if (scene.contacts && scene.contacts.total > contacts.length) {
    lines.push(`${number(contacts.length)} of ${number(scene.contacts.total)} contacts are shown.`);
  }
  if (contacts.length > listedContacts) lines.push(`The first ${listedContacts} contacts are listed.`);
  byId('notes').textContent = lines.join(' ');
}

function pointer() {
  let last = null;
  canvas.addEventListener('pointerdown', (e) => { last = e; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener('pointerup', () => { last = null; });
  canvas.addEventListener('pointercancel', () => { last = null; });
  canvas.addEventListener('pointermove', (e) => {
    if (!last || e.pointerId !== last.pointerId) return;
    const [dx, dy] = [e.clientX - last.clientX, e.clientY - last.clientY];
    if (e.shiftKey || e.buttons === 4) {
      camera.aim[0] += dx / canvas.clientHeight * camera.distance * 0.85;
      camera.aim[1] -= dy / canvas.clientHeight * camera.distance * 0.85;
    } else {
      camera.turn -= dx * 0.008;
      camera.tilt = Math.max(-1.57, Math.min(1.57, camera.tilt + dy * 0.008));
    }
    last = e;
    drawSoon();
  });
  const zoom = (factor) => {
    camera.distance = Math.max(0.002, Math.min(30, camera.distance * factor));
    drawSoon();
  };
  canvas.addEventListener('wheel', (e) => { e.preventDefault(); zoom(Math.exp(e.deltaY * 0.0012)); }, {passive: false});
  canvas.addEventListener('keydown', (e) => {
    if (e.key === '+' || e.key === '-') zoom(e.key === '+' ? 0.85 : 1 / 0.85);
  });
}

/** A place in the unit ball is looked at from its side of the scene. */
function lookFromTheSideOf(place) {
  const distance = Math.hypot(...place);
  if (!(distance > 0.02)) return;
  camera.turn = Math.atan2(place[1], place[0]) + 0.35;
  camera.tilt = Math.max(-0.9, Math.min(1.2, Math.asin(place[2] / distance) + 0.2));
}

function lookAtAll() {
  Object.assign(camera, {distance: 2.5, aim: [0, 0], focus: [0, 0, 0]});
  const middle = [0, 0, 0];
  for (const {position} of contacts) {
    matrix.applied(toBall, position).forEach((x, k) => { middle[k] += x / contacts.length; });
  }
  lookFromTheSideOf(middle);
  choseContact(-1);
}

/** Zooms to a contact; -1: none. */
function choseContact(at) {
  chosenContact = at;
  [...byId('contact-list').children].forEach((line, i) => {
    line.firstChild.setAttribute('aria-current', String(i === at));
  });
  if (at >= 0) {
    const place = matrix.applied(toBall, contacts[at].position);
    Object.assign(camera, {distance: Math.min(camera.distance, 0.3), aim: [0, 0], focus: place});
    lookFromTheSideOf(place);
  }
  drawSoon();
}

const listedContacts = 200;
function listContacts() {
  const digits = (x) => Number(x.toPrecision(4));
  byId('contact-list').replaceChildren(...contacts.slice(0, listedContacts).map((contact, i) => {
    const line = document.createElement('li'), button = document.createElement('button');
    button.type = 'button';
    button.textContent = `${i + 1}: at ${Array.from(contact.position, digits).join(', ')}, depth ${digits(contact.depth)}, ` +
      `${scene.contacts.of} ${contact.a} and ${contact.b}`;
    button.addEventListener('click', () => choseContact(i));
    line.append(button);
    return line;
  }));
}

/** What is drawn in which colour; each of two objects is shown or not. */
function legend() {
  const css = (color) => `rgb(${color.map((x) => Math.round(255 * x)).join(' ')})`;
  const swatch = (color, text) => {
    const square = document.createElement('span');
    square.className = 'swatch';
    square.style.background = css(color);
    return [square, text];
  };
  const row = (...parts) => {
    const line = document.createElement('li');
    line.append(...parts);
    byId('legend').append(line);
  };
  if (states.length > 0) {
    row(...swatch(objectColors[0], 'moves'), ...swatch(objectColors[1], 'does not move'), ...swatch(touchColor, 'touches'));
    return;
  }
  scene.objects.forEach((object, o) => {
    const label = document.createElement('label');
    if (scene.objects.length > 1) {
      const box = document.createElement('input');
      Object.assign(box, {type: 'checkbox', id: `object-${o}`, checked: true});
      box.addEventListener('input', () => {
        chosen.shown[o] = box.checked;
        refill();
      });
      label.append(box, ' ');
    }
    label.append(object.name);
    row(label, ...swatch(objectColors[o % 2], 'surface'), ...(kinds.length > 0 ? swatch(volumeColors[o % 2], 'volumes') : []));
  });
  if (contacts.length > 0) row(...swatch(pointColor, 'contacts'), ...swatch(normalColor, 'normals, from A to B'));
  if (scene.objects.some((object) => decodedFaults(object).length > 0)) row(...swatch(faultColor, 'faults'));
}

function start() {
  document.title = scene.title + ' - bocst';
  byId('title').textContent = scene.title;
  for (const [name, value] of scene.facts) {
    const row = byId('facts').insertRow();
    row.insertCell().textContent = name;
    row.insertCell().textContent = value;
  }
  for (const name of kinds) byId('tree').add(new Option(name));
  byId('tree-row').hidden = kinds.length < 2;
  byId('contacts-row').hidden = contacts.length === 0;
  byId('volumes-row').hidden = kinds.length === 0;
  byId('states-row').hidden = states.length === 0;
  byId('state').max = Math.max(0, states.length - 1);
  byId('state').value = 0;
  byId('next').disabled = !states.some((state) => state.contacts.length > 0);
  byId('faults-row').hidden = !scene.objects.some((object) => decodedFaults(object).length > 0);
  // A tree that queries grew ends at many levels; a fully expanded one ends at one.
  byId('cut-row').hidden = !scene.contacts;
  byId('level').max = Math.max(1, ...treesShown().map((tree) => tree ? tree.levels : 1));
  byId('level').value = Math.min(Number(byId('level').max), 5);
  legend();
  listContacts();
  lookAtAll();
  if (gl) {
    prepare();
    pointer();
    new ResizeObserver(drawSoon).observe(canvas);
    canvas.addEventListener('webglcontextlost', (e) => e.preventDefault());
    canvas.addEventListener('webglcontextrestored', () => { prepare(); refill(); });
  } else {
    byId('problem').textContent = 'This browser has no WebGL 2, so the 3D view is not shown.';
    byId('problem').hidden = false;
  }
  byId('tree').addEventListener('input', treeChosen);
  byId('state').addEventListener('input', stateChosen);
  byId('next').addEventListener('click', nextCollision);
  byId('whole').addEventListener('click', lookAtAll);
  for (const id of ['level', 'cut']) byId(id).addEventListener('input', refill);
  for (const id of ['volume', 'opacity', 'mesh', 'wires', 'fixed', 'faults', 'contacts', 'up']) byId(id).addEventListener('input', drawSoon);
  notes();
  if (states.length > 0) stateChosen();
  refill();
}

start();
})();
