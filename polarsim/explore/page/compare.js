// Two images of a photo key under a slider: photo, twins, difference, sum over lamps.

import { bracketOf, has, keyOf, known, nearestExposure, parts, pictureUrl, run } from './data.js';
import { chooser, h, renew, s, slider, soon, toggle } from './dom.js';
import { unknown } from './filters.js';
import * as overlay from './overlay.js';
import { difference, exposed, read, summed, whiteOf } from './picture.js';
import { set, shows, state, switchMark } from './state.js';

const LONGEST = 2 ** 40; // ms, longer than any exposure
/** Lamps of the run: name, light and azimuth of the photos with this lamp only. */
const lamps = () => [...run.about.suns.map((name) => [name, 'off', name]), ...(run.about.rig_lamp ? [['rover', 'on', 'no']] : [])];
const MARKS = [['b', 'boxes'], ['m', 'masks'], ['i', 'ids'], ['l', 'lines'], ['p', 'predictions']];

let controls = null, marks = null, canvases = [], svg = null, divider = null, tags = [], note = null, frame = null, status = null;

export function build(section) {
  controls = h('div', { class: 'bar' });
  marks = h('div', { class: 'bar' });
  canvases = [h('canvas', { role: 'img', 'aria-label': 'right image' }), h('canvas', { role: 'img', 'aria-label': 'left image' })];
  svg = s('svg', { viewBox: `0 0 ${run.about.width} ${run.about.height}`, role: 'img', 'aria-label': 'labels', style: `--scale: ${overlay.photoScale()}` });
  divider = h('div', { class: 'divider' });
  tags = [h('span', { class: 'tag left' }), h('span', { class: 'tag right' })];
  status = h('span', { role: 'status', id: 'prediction-count' });
  note = h('p', { class: 'empty', role: 'status' });
  frame = h('div', { class: 'frame', onpointermove: drag, onpointerdown: drag }, ...canvases, svg, divider, ...tags);
  section.append(h('div', { class: 'column' }, controls, marks, note, h('div', { class: 'stage' }, frame)));
  new ResizeObserver(([{ contentRect: { width, height } }]) => {
    const wide = Math.min(width, height * run.about.width / run.about.height);
    Object.assign(frame.style, { width: `${wide}px`, height: `${wide * run.about.height / run.about.width}px` });
  }).observe(frame.parentElement);
}

function drag(event) {
  if (!event.buttons || event.target.classList.contains('box')) return;
  const { left, width } = frame.getBoundingClientRect();
  set({ split: Math.round(Math.min(100, Math.max(0, (100 * (event.clientX - left)) / width))) });
}

const sides = () => ['photo', ...run.about.domains.slice(1), ...(run.about.domains.length > 1 ? ['difference', 'olat'] : [])];
const model = () => [state.right, state.left, run.about.domains[1]].find((one) => run.about.domains.slice(1).includes(one));

export const twinOf = () => state.right || run.about.domains[1] || 'photo';

/** Redraw the view. */
export const refresh = soon(async () => {
  const shown = known(state.key);
  note.hidden = shown;
  note.textContent = unknown(state.key);
  controls.hidden = marks.hidden = frame.parentElement.hidden = !shown;
  if (!shown) return;
  drawControls();
  const [{ seen }] = await Promise.all([overlay.draw(svg, state.key), drawPictures()]);
  status.textContent = !shows('p') || !state.detector ? '' : seen ? `${seen.length} predictions` : 'the detector was not tested on this photo';
});

function drawControls() {
  const { exposure } = parts(state.key), bracket = bracketOf(state.key), times = run.brackets.get(bracket) ?? [exposure];
  const change = (index) => set({ key: keyOf({ ...parts(state.key), exposure: times[index] }) });
  renew(controls, () => [
    h('strong', { id: 'key', text: state.key }),
    chooser('left', sides(), state.left, (left) => set({ left })),
    chooser('right', sides(), twinOf(), (right) => set({ right })),
    slider('divider', { min: 0, max: 100, step: 1, value: state.split, shown: (value) => `${value} %` }, (split) => set({ split })),
    slider('exposure', { min: 0, max: times.length - 1, step: 1, value: times.indexOf(exposure), disabled: times.length < 2, shown: (index) => `${times[index]} ms` }, change),
    slider('brightness', { min: -6, max: 6, step: 0.5, value: state.ev, shown: (value) => `${value > 0 ? '+' : ''}${value} stops` }, (ev) => set({ ev })),
    toggle('auto', Boolean(state.auto), (on) => set({ auto: on ? 1 : 0 }), 'On: white is the 99.7th percentile of the photo. Off: white is 4095 DN'),
  ]);
  renew(marks, () => [
    ...MARKS.map(([mark, text]) => toggle(text, shows(mark), () => switchMark(mark), `key ${mark}`)),
    chooser('labels of', [['photo', 'photos (propagated)'], ['twins', 'twins (rendered)']], state.labels, (labels) => set({ labels })),
    chooser('detector', [['', 'none'], ...run.about.predictions], state.detector, (detector) => set({ detector, show: shows('p') ? state.show : `${state.show}p` })),
    ...(shows('p') && state.detector ? [slider('confidence', { min: 0.05, max: 0.99, step: 0.01, value: state.confidence, shown: (value) => `≥ ${value.toFixed(2)}` }, (confidence) => set({ confidence }))] : []),
    status,
    h('button', { type: 'button', text: 'correct', onclick: () => set({ view: 'correct' }) }),
    ...(needsLamps() ? lampSliders() : []),
  ]);
}

const needsLamps = () => state.left === 'olat' || twinOf() === 'olat';

/** Weights of the lamps in the state, by default those of the photo. */
function weights() {
  const values = state.lamps.split(',').map(Number);
  if (state.lamps && values.length === lamps().length) return values;
  const { azimuth, light } = parts(state.key);
  return lamps().map(([name]) => Number(name === azimuth || (name === 'rover' && light === 'on')));
}

function lampSliders() {
  const now = weights();
  return lamps().map(([name], index) => slider(`lamp ${name}`, { min: 0, max: 3, step: 0.1, value: now[index], shown: (value) => value.toFixed(1) }, (value) => {
    now[index] = value;
    set({ lamps: now.join(',') });
  }));
}

async function drawPictures() {
  const key = state.key;
  const reference = await read(pictureUrl(has('photo', key) ? 'photo' : model() ?? 'photo', key)).catch(() => null);
  const gain = 2 ** state.ev / (state.auto && reference ? whiteOf(reference) : 1);
  const pictures = await Promise.all([pictureOf(twinOf(), key, gain), pictureOf(state.left, key, gain)]);
  if (key !== state.key) return; // the selection has changed
  pictures.forEach((data, index) => {
    const canvas = canvases[index];
    canvas.hidden = !data;
    if (!data) return;
    canvas.width = data.width;
    canvas.height = data.height;
    canvas.getContext('2d').putImageData(data, 0, 0);
  });
  const name = (side) => ({ difference: `log2(${model()} / photo), blue to orange: -2 to 2 stops`, olat: `weighted sum of ${model()} twins, a lamp each` })[side] ?? side;
  tags[0].textContent = `${name(state.left)}${pictures[1] ? '' : ': not available'}`;
  tags[1].textContent = `${name(twinOf())}${pictures[0] ? '' : ': not available'}`;
  drawSplit();
  frame.dataset.drawn = `${key} ${state.left} ${twinOf()}`;
}

export function drawSplit() {
  canvases[1].style.clipPath = `inset(0 ${100 - state.split}% 0 0)`;
  divider.style.left = `${state.split}%`;
  const [input, output] = controls.querySelectorAll('input[aria-label="divider"], input[aria-label="divider"] + output');
  if (input) { input.value = state.split; output.textContent = `${state.split} %`; }
}

async function pictureOf(side, key, gain) {
  try {
    if (side === 'difference') return difference(await read(pictureUrl('photo', key)), await read(pictureUrl(model(), key)));
    if (side === 'olat') return await sumOf(key, gain);
    return has(side, key) ? exposed(await read(pictureUrl(side, key)), gain) : null;
  } catch (error) {
    console.warn(error.message);
    return null;
  }
}

/** Weighted sum of the twins of single lamps, scaled to the photo's exposure. */
async function sumOf(key, gain) {
  const fields = parts(key), chosen = [];
  weights().forEach((weight, index) => {
    const [, light, azimuth] = lamps()[index];
    const bracket = bracketOf(keyOf({ ...fields, light, azimuth }));
    const exposure = nearestExposure(bracket, azimuth === 'no' ? LONGEST : fields.exposure);
    const single = keyOf({ ...fields, light, azimuth, exposure });
    if (weight > 0 && has(model(), single)) chosen.push([single, (weight * fields.exposure) / exposure]);
  });
  if (!chosen.length) return null;
  const pictures = await Promise.all(chosen.map(([single]) => read(pictureUrl(model(), single))));
  return summed(pictures, chosen.map(([, weight]) => weight), gain);
}

/** Select the exposure `by` steps further in the bracket. */
export function stepExposure(by) {
  if (!known(state.key)) return;
  const fields = parts(state.key), times = run.brackets.get(bracketOf(state.key)) ?? [];
  const next = times[times.indexOf(fields.exposure) + by];
  if (next) set({ key: keyOf({ ...fields, exposure: next }) });
}

/** Select the next rock of the photo. */
export async function nextRock() {
  if (!known(state.key)) return;
  const { terrain } = parts(state.key);
  const rocks = [...new Set((await overlay.labels(state.key, state.labels !== 'photo')).map((one) => one.rock))].filter((rock) => rock >= 0).sort((a, b) => a - b);
  if (!rocks.length) return;
  const now = rocks.findIndex((rock) => state.rock === `${terrain}.${rock}`);
  set({ rock: `${terrain}.${rocks[(now + 1) % rocks.length]}` });
}
