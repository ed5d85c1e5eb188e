// A drive on the map, with the images of the cameras.

import { json, run } from './data.js';
import { chooser, h, renew, s, slider, soon } from './dom.js';
import { set, state } from './state.js';

let controls = null, map = null, picture = null, note = null, drive = null;

export function build(section) {
  controls = h('div', { class: 'bar' });
  note = h('p', { class: 'empty' });
  map = h('div', { class: 'map' });
  picture = h('div', { class: 'stage' });
  section.append(h('div', { class: 'column' }, controls, note, h('div', { class: 'work' }, map, picture)));
}

const nameNow = () => state.drive || run.about.drives[0];
const viewNow = () => drive.views.find((one) => one.name === state.sight) ?? drive.views[0];
const looksOf = (view) => Object.keys(view?.looks ?? {});

export const refresh = soon(async () => {
  note.hidden = run.about.drives.length > 0;
  map.parentElement.hidden = !note.hidden;
  note.textContent = 'This run has no drive; set rover.run in the configuration.';
  if (!run.about.drives.length) return;
  drive = await json(`data/drives/${nameNow()}.json`);
  const view = viewNow(), looks = looksOf(view), look = looks.includes(state.look) ? state.look : looks[0];
  const frames = view ? view.frames : [], index = Math.max(0, frames.indexOf(state.frame));
  renew(controls, () => [
    chooser('drive', run.about.drives, nameNow(), (value) => set({ drive: value })),
    ...(view ? [
      chooser('camera', drive.views.map((one) => one.name), view.name, (sight) => set({ sight })),
      chooser('light and model', looks, look ?? '', (value) => set({ look: value })),
      slider('frame', { min: 0, max: Math.max(0, frames.length - 1), step: 1, value: index, shown: (number) => `${frames[number]} at ${view.time_s[number].toFixed(1)} s` }, (number) => set({ frame: frames[number] })),
    ] : []),
    h('span', { text: `${drive.length_m.toFixed(1)} m` }),
  ]);
  drawMap(view, index);
  const available = view && look && view.looks[look].includes(frames[index]);
  const url = available ? `data/drives/${nameNow()}/${view.name}/${look}/${String(frames[index]).padStart(5, '0')}.jpg` : '';
  picture.replaceChildren(available
    ? h('img', { src: url, alt: `frame ${frames[index]} of ${view.name}`, style: 'width:100%;height:100%;object-fit:contain' })
    : h('p', { class: 'empty', text: 'No image of this frame.' }));
});

function drawMap(view, index) {
  const { x0_m: x0, y0_m: y0, width_m: width, height_m: height } = drive.map;
  const at = (x, y) => [x - x0, y0 + height - y]; // north up
  const points = pairs(drive.path).map(([x, y]) => at(x, y).map((value) => value.toFixed(3)).join()).join(' ');
  const size = Math.max(width, height);
  const dots = view ? pairs(view.rover).map(([x, y], number) => {
    const [u, v] = at(x, y);
    return s('circle', {
      cx: u, cy: v, r: (number === index ? 0.014 : 0.006) * size, fill: number === index ? '#ffb000' : '#fff', 'data-frame': view.frames[number], style: 'cursor:pointer',
      onclick: () => set({ frame: view.frames[number] }),
    });
  }) : [];
  if (dots.length) dots.unshift(...sightOf(at(...pairs(view.positions)[index]), at(...pairs(view.rover)[index]), size));
  map.replaceChildren(s('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': 'map of the drive', style: 'width:100%;height:100%' },
    s('image', { href: `data/drives/${nameNow()}/map.jpg`, width, height, preserveAspectRatio: 'none' }),
    ...drive.rocks.map((one) => rockOf(one, at(one.x_m, one.y_m))),
    s('polyline', { points, fill: 'none', stroke: '#56b4e9', 'stroke-width': 0.006 * size }), ...dots));
}

/** Mark of the camera of a frame, and a line to the rover. */
const sightOf = ([x, y], [u, v], size) => [
  s('line', { x1: x, y1: y, x2: u, y2: v, stroke: '#fff', 'stroke-width': 0.002 * size, 'stroke-dasharray': `${0.01 * size}` }),
  s('circle', { cx: x, cy: y, r: 0.009 * size, fill: 'none', stroke: '#fff', 'stroke-width': 0.003 * size, class: 'camera' }),
];

const rockOf = (one, [u, v]) => s('circle', {
  cx: u, cy: v, r: Math.max(0.03, one.radius_m), fill: state.rock === one.rock ? '#fff' : '#ffb000', 'fill-opacity': 0.75, style: 'cursor:pointer', class: 'stone',
  onclick: () => set({ rock: one.rock }),
}, s('title', { text: `rock ${one.rock.split('.')[1]} of terrain ${one.rock.split('.')[0]}` }));

const pairs = (numbers) => Array.from({ length: numbers.length / 2 }, (_, k) => [numbers[2 * k], numbers[2 * k + 1]]);

/** Select the frame `by` steps further. */
export function step(by) {
  const frames = drive ? viewNow()?.frames ?? [] : [];
  const next = frames[Math.max(0, frames.indexOf(state.frame)) + by];
  if (next !== undefined) set({ frame: next });
}
