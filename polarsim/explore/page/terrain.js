// The terrain in 3-D: meshes coloured by vertex attributes, camera frustums, lamps.

import { json, rockOf, row, run, table, terrainOf } from './data.js';
import { chooser, h, renew, soon } from './dom.js';
import * as matrix from './matrix.js';
import { set, state } from './state.js';

const MOST_MM = 10, UNKNOWN = [90, 90, 96];
const COLOURS = [['lit', 'light'], ['id', 'rock ids'], ['error_mm', 'error'], ['support', 'support']];
// Okabe and Ito's colours without black, for colour-blind readers.
const PALETTE = [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];
const LAMP = [255, 240, 140], CAMERA = [255, 255, 255];

const SOLID = `#version 300 es
in vec3 position; in vec3 normal; in vec3 colour; uniform mat4 view; uniform vec3 light; uniform float flat_; out vec3 shade;
void main() {
  gl_Position = view * vec4(position, 1.0);
  float lit = 0.35 + 0.65 * max(0.0, dot(normalize(normal), light));
  shade = colour * mix(lit, 1.0, flat_);
}`;
const PAINT = `#version 300 es
precision mediump float; in vec3 shade; out vec4 colour; void main() { colour = vec4(shade, 1.0); }`;

let canvas = null, gl = null, program = null, controls = null, names = null, legend = null, message = null;
let shown = null; // {terrain, mesh, index, count, rock, lines, marks, around}
let orbit = { yaw: -0.6, pitch: 0.7, far: 6, at: [0, 0, 0] };

export function build(section) {
  controls = h('div', { class: 'bar' });
  canvas = h('canvas', { id: 'scene', tabindex: 0, role: 'img', 'aria-label': 'terrain in 3-D; drag to rotate, wheel to zoom' });
  names = h('div');
  legend = h('div', { class: 'legend' });
  message = h('p', { class: 'empty', role: 'status' });
  section.append(h('div', { class: 'column' }, controls, message, h('div', { class: 'stage' }, canvas, names, legend)));
  gl = canvas.getContext('webgl2', { antialias: true, preserveDrawingBuffer: true });
  if (!gl) { message.textContent = 'This browser does not support WebGL 2.'; return; }
  program = link(SOLID, PAINT);
  gl.enable(gl.DEPTH_TEST);
  listen();
  new ResizeObserver(draw).observe(canvas);
}

function link(vertex, fragment) {
  const linked = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(linked, shader);
  }
  ['position', 'normal', 'colour'].forEach((name, location) => gl.bindAttribLocation(linked, location, name));
  gl.linkProgram(linked);
  return linked;
}

const terrainNow = () => terrainOf(state.terrain || (state.rock || state.key).split(/[._]/)[0]) || run.about.meshes[0] || run.about.terrains[0];

export async function refresh(changed) {
  if (!gl) return;
  const terrain = terrainNow();
  if (!shown || shown.terrain !== terrain) await load(terrain);
  if (changed.has('orbit') || changed.has('all')) takeOrbit();
  if ((changed.has('rock') || changed.has('all') || changed.has('view')) && state.rock && !state.orbit) await lookAtRock();
  renew(controls, () => [
    chooser('terrain', run.about.terrains, terrain, (value) => set({ terrain: value, camera: '', orbit: '' })),
    chooser('colour', COLOURS, state.colour, (colour) => set({ colour })),
    chooser('look through', [['', 'free view'], ...shown.around.cameras.map((one) => [one.position + one.camera, `camera ${one.position} ${one.camera}`])], state.camera, (camera) => set({ camera })),
    h('button', { type: 'button', text: 'from above', onclick: () => turn({ yaw: -Math.PI / 2, pitch: 1.55, far: 6, at: [0, 0, 0] }) }),
  ]);
  paint();
  draw();
}

async function load(terrain) {
  message.textContent = `loading terrain ${terrain} ...`;
  const [around, vertices, faces] = await Promise.all([
    json(`data/terrain/${terrain}.json`),
    ...['vertices', 'faces'].map((name) => (run.about.meshes.includes(terrain) ? table(`data/terrain/${terrain}/${name}.arrow`) : null)),
  ]);
  if (shown) for (const buffer of shown.buffers) gl.deleteBuffer(buffer);
  shown = { terrain, around, buffers: [], marks: [], rocks: vertices ? tops(vertices.columns) : [], table: vertices, count: 0 };
  if (vertices) {
    const { x, y, z, nx, ny, nz } = vertices.columns;
    const { a, b, c } = faces.columns;
    shown.mesh = gl.createVertexArray();
    gl.bindVertexArray(shown.mesh);
    attribute(0, interleaved(x, y, z));
    attribute(1, interleaved(nx, ny, nz));
    shown.colours = attribute(2, new Uint8Array(3 * vertices.rows), gl.UNSIGNED_BYTE);
    const index = buffer(gl.ELEMENT_ARRAY_BUFFER, Uint32Array.from({ length: 3 * faces.rows }, (_, k) => [a, b, c][k % 3][Math.floor(k / 3)]));
    shown.buffers.push(index);
    shown.count = 3 * faces.rows;
  }
  shown.lines = linesOf(around);
  gl.bindVertexArray(null);
  message.textContent = vertices ? '' : 'This terrain has no meshes.';
  message.hidden = Boolean(vertices);
}

/** The highest vertex of each rock with the id. */
function tops({ rock, x, y, z }) {
  const highest = new Map();
  for (let k = 0; k < rock.length; k += 1) if (rock[k] >= 0 && !(z[k] <= z[highest.get(rock[k])])) highest.set(rock[k], k);
  return [...highest].map(([id, k]) => [[x[k], y[k], z[k]], String(id)]);
}

function buffer(kind, content) {
  const made = gl.createBuffer();
  gl.bindBuffer(kind, made);
  gl.bufferData(kind, content, gl.STATIC_DRAW);
  shown.buffers.push(made);
  return made;
}

function attribute(location, content, kind = gl.FLOAT) {
  const made = buffer(gl.ARRAY_BUFFER, content);
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, 3, kind, kind !== gl.FLOAT, 0, 0);
  return made;
}

function interleaved(x, y, z) {
  const out = new Float32Array(3 * x.length);
  for (let k = 0; k < x.length; k += 1) { out[3 * k] = x[k]; out[3 * k + 1] = y[k]; out[3 * k + 2] = z[k]; }
  return out;
}

/** Frustums of cameras, 0.8 m long, and a star at each lamp with a ray to the centre. */
function linesOf({ cameras, lamps, rover_lights: rovers }) {
  const positions = [], colours = [];
  const add = (from, to, colour) => { positions.push(...from, ...to); colours.push(...colour, ...colour); };
  for (const { position, camera, sandbox_from_camera: pose, lens: [fx, fy, cx, cy] } of cameras) {
    const at = [pose[3], pose[7], pose[11]];
    const corner = (u, v) => {
      const ray = [0.8 * (u - cx) / fx, 0.8 * (v - cy) / fy, 0.8];
      return at.map((value, k) => value + pose[4 * k] * ray[0] + pose[4 * k + 1] * ray[1] + pose[4 * k + 2] * ray[2]);
    };
    const corners = [[0, 0], [run.about.width, 0], [run.about.width, run.about.height], [0, run.about.height]].map(([u, v]) => corner(u, v));
    corners.forEach((one, k) => { add(at, one, CAMERA); add(one, corners[(k + 1) % 4], CAMERA); });
    if (camera === 'L') shown.marks.push([at, `camera ${position}`]);
  }
  const star = (at, size) => [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis) => add(matrix.plus(at, axis, -size), matrix.plus(at, axis, size), LAMP));
  for (const [azimuth, at] of Object.entries(lamps)) {
    star(at, 0.12);
    add(at, [0, 0, 0], LAMP.map((value) => 0.45 * value));
    shown.marks.push([at, `Sun lamp ${azimuth}`]);
  }
  for (const at of Object.values(rovers)) star(at, 0.04);
  const made = gl.createVertexArray();
  gl.bindVertexArray(made);
  attribute(0, Float32Array.from(positions));
  attribute(1, Float32Array.from(positions, (_, k) => Number(k % 3 === 2))); // a zero normal would have no direction
  attribute(2, Uint8Array.from(colours), gl.UNSIGNED_BYTE);
  return { array: made, count: positions.length / 3 };
}

/** Set the colours of the vertices by the selected attribute. */
function paint() {
  const { table: vertices } = shown;
  if (!vertices) return;
  const { rock, support, error_mm: error } = vertices.columns;
  const chosen = state.rock.startsWith(`${shown.terrain}.`) ? Number(state.rock.split('.')[1]) : null;
  const out = new Uint8Array(3 * vertices.rows);
  for (let k = 0; k < vertices.rows; k += 1) {
    let colour = rock[k] < 0 ? [150, 144, 132] : [196, 176, 140];
    if (state.colour === 'id' && rock[k] >= 0) colour = PALETTE[rock[k] % PALETTE.length];
    if (state.colour === 'error_mm') colour = Number.isNaN(error[k]) ? UNKNOWN : off(error[k] / MOST_MM);
    if (state.colour === 'support') colour = known(support[k]);
    if (rock[k] === chosen) colour = state.colour === 'lit' ? [255, 176, 0] : colour.map((value) => 0.4 * value + 153);
    out.set(colour, 3 * k);
  }
  gl.bindBuffer(gl.ARRAY_BUFFER, shown.colours);
  gl.bufferData(gl.ARRAY_BUFFER, out, gl.STATIC_DRAW);
  drawLegend();
}

const mix = (from, to, share) => from.map((value, k) => Math.round(value + (to[k] - value) * share));
const off = (value) => mix([225, 225, 225], value < 0 ? [0, 90, 200] : [220, 90, 0], Math.min(1, Math.abs(value)));
const known = (value) => mix([0, 34, 78], [253, 231, 55], value); // the ends of cividis

function drawLegend() {
  const strip = (make) => h('i', { style: `background:linear-gradient(90deg,${[0, 0.25, 0.5, 0.75, 1].map((t) => `rgb(${make(t)})`)})` });
  const legends = {
    lit: ['Amber: the chosen rock.'], id: ['Rock ids; neighbours may share a colour.'],
    error_mm: [`inside the true surface by ${MOST_MM} mm`, strip((t) => off(2 * t - 1)), `outside by ${MOST_MM} mm; dark grey: not known`],
    support: ['interpolated', strip(known), 'scanned'],
  };
  legend.replaceChildren(...(legends[state.colour] ?? legends.lit));
}

function view() {
  const aspect = canvas.clientWidth / Math.max(1, canvas.clientHeight);
  const camera = shown.around.cameras.find((one) => one.position + one.camera === state.camera);
  if (camera) {
    const tanY = run.about.height / 2 / camera.lens[1];
    return matrix.product(matrix.perspective(Math.max(tanY * aspect, 1e-3), tanY, 0.05, 40), matrix.throughCamera(camera.sandbox_from_camera));
  }
  const { yaw, pitch, far, at } = orbit;
  const eye = matrix.plus(at, [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)], far);
  return matrix.product(matrix.perspective(0.45 * aspect, 0.45, 0.02, 60), matrix.looking(eye, at));
}

let waiting = false;

/** Draw at the browser's next frame; repeated calls are merged. */
function draw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; drawNow(); });
}

function drawNow() {
  if (!gl || !shown || !canvas.clientWidth) return;
  const ratio = Math.min(2, devicePixelRatio || 1);
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(canvas.clientHeight * ratio);
  const matrixNow = view();
  drawInto(matrixNow, false);
  const marks = [...(state.camera ? [] : shown.marks), ...(state.colour === 'id' ? shown.rocks : [])];
  names.replaceChildren(...marks.flatMap(([at, text]) => {
    const [x, y, , w] = matrix.project(matrixNow, at);
    if (w <= 0 || Math.abs(x) > 1 || Math.abs(y) > 1) return [];
    const half = `${0.3 * text.length + 0.3}em`; // the text stays inside the view
    return [h('span', { class: 'name', text, style: `left:clamp(${half}, ${50 + 50 * x}%, calc(100% - ${half}));top:max(2em, ${50 - 50 * y}%)` })];
  }));
  canvas.dataset.drawn = `${shown.terrain} ${state.colour} ${shown.count / 3}`;
}

function drawInto(matrixNow, flat) {
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(...(flat ? [0, 0, 0, 1] : [0.06, 0.063, 0.07, 1]));
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.useProgram(program);
  gl.uniformMatrix4fv(gl.getUniformLocation(program, 'view'), false, matrixNow);
  gl.uniform3fv(gl.getUniformLocation(program, 'light'), matrix.unit([0.8, 0.35, 0.5]));
  gl.uniform1f(gl.getUniformLocation(program, 'flat_'), flat ? 1 : 0);
  if (shown.count) {
    gl.bindVertexArray(shown.mesh);
    gl.drawElements(gl.TRIANGLES, shown.count, gl.UNSIGNED_INT, 0);
  }
  if (!flat && !state.camera && shown.lines.count) {
    gl.uniform1f(gl.getUniformLocation(program, 'flat_'), 1);
    gl.bindVertexArray(shown.lines.array);
    gl.drawArrays(gl.LINES, 0, shown.lines.count);
  }
  gl.bindVertexArray(null);
}

/** The rock at a point of the canvas, by rendering the scene with rock ids as colours and reading a pixel. */
function pick(x, y) {
  const { rock } = shown.table.columns;
  const numbers = new Uint8Array(3 * rock.length);
  for (let k = 0; k < rock.length; k += 1) { const code = rock[k] + 2; numbers[3 * k] = code & 255; numbers[3 * k + 1] = code >> 8; }
  gl.bindBuffer(gl.ARRAY_BUFFER, shown.colours);
  gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
  const target = gl.createFramebuffer(), texture = gl.createTexture(), depth = gl.createRenderbuffer();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, canvas.width, canvas.height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT16, canvas.width, canvas.height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  drawInto(view(), true);
  const pixel = new Uint8Array(4), ratio = canvas.width / canvas.clientWidth;
  gl.readPixels(Math.round(x * ratio), canvas.height - 1 - Math.round(y * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.deleteFramebuffer(target);
  gl.deleteTexture(texture);
  gl.deleteRenderbuffer(depth);
  paint();
  return pixel[0] + 256 * pixel[1] - 2;
}

async function lookAtRock() {
  const [terrain, rock] = rockOf(state.rock);
  if (terrain !== shown.terrain) return;
  const facts = await table(`data/rocks/${terrain}.arrow`);
  const index = facts.columns.rock ? facts.columns.rock.indexOf(rock) : -1;
  if (index < 0) return;
  const { x, y, z, size_m: size } = row(facts, index);
  orbit = { ...orbit, at: [x, y, z], far: Math.max(0.5, 6 * (size || 0.2)) };
}

function takeOrbit() {
  const numbers = state.orbit.split(',').map(Number);
  if (numbers.length === 6 && numbers.every(Number.isFinite)) {
    const [yaw, pitch, far, ...at] = numbers;
    orbit = { yaw, pitch, far, at };
  } else if (!state.rock) orbit = { yaw: -0.6, pitch: 0.7, far: 6, at: [0, 0, 0] };
}

const keep = soon(() => set({ orbit: [orbit.yaw, orbit.pitch, orbit.far, ...orbit.at].map((value) => Number(value.toFixed(3))).join(','), camera: '' }), 200);

function turn(to) {
  orbit = to;
  if (state.camera) set({ camera: '' });
  draw();
  keep();
}

function turned(dx, dy) {
  turn({ ...orbit, yaw: orbit.yaw - dx, pitch: Math.min(1.55, Math.max(-0.2, orbit.pitch + dy)) });
}

function moved(dx, dy) {
  const across = [-Math.sin(orbit.yaw), Math.cos(orbit.yaw), 0], along = [Math.cos(orbit.yaw), Math.sin(orbit.yaw), 0];
  turn({ ...orbit, at: matrix.plus(matrix.plus(orbit.at, across, -dx * orbit.far), along, -dy * orbit.far) });
}

const zoomed = (factor) => turn({ ...orbit, far: Math.min(30, Math.max(0.2, orbit.far * factor)) });

function listen() {
  let last = null, gone = 0;
  canvas.addEventListener('pointerdown', (event) => { last = [event.clientX, event.clientY]; gone = 0; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener('pointermove', (event) => {
    if (!last) return;
    const dx = event.clientX - last[0], dy = event.clientY - last[1];
    last = [event.clientX, event.clientY];
    gone += Math.abs(dx) + Math.abs(dy);
    if (gone < 4) return;
    if (event.shiftKey || event.buttons === 2) moved(dx / canvas.clientHeight, dy / canvas.clientHeight); else turned(dx / 200, dy / 200);
  });
  canvas.addEventListener('pointerup', (event) => {
    last = null;
    if (gone >= 4 || !shown.table) return;
    const { left, top } = canvas.getBoundingClientRect();
    const rock = pick(event.clientX - left, event.clientY - top);
    draw();
    if (rock >= 0) set({ rock: `${shown.terrain}.${rock}` });
  });
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('wheel', (event) => { event.preventDefault(); zoomed(Math.exp(event.deltaY / 800)); }, { passive: false });
  canvas.addEventListener('keydown', (event) => {
    const act = { ArrowLeft: () => turned(-0.1, 0), ArrowRight: () => turned(0.1, 0), ArrowUp: () => turned(0, 0.1), ArrowDown: () => turned(0, -0.1), '+': () => zoomed(0.85), '-': () => zoomed(1.18) }[event.key];
    if (act) { event.preventDefault(); event.stopPropagation(); act(); }
  });
}
