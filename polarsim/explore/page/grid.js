// Grid of images; only the visible tiles are created.

import { domainAt, has, keyAt, labelsOf, rockOf, run, smallUrl } from './data.js';
import { chooser, h, renew, toggle } from './dom.js';
import { filtered, form, resetButton } from './filters.js';
import { set, state } from './state.js';
import { brightening } from './picture.js';

const WIDE = 190, HIGH = 160, EDGE = 6, MARGIN = 2; // sizes of tile and edge, pixels; extra rows above and below the visible part

const SORTS = [['key', 'photo'], ['score', 'score'], ['confidence', 'mean confidence'], ['min_confidence', 'minimum confidence'], ['rocks', 'number of rocks']];

let page = null, list = null, inner = null, count = null, filters = null, order = null, none = null;
export let shown = []; // rows of the pictures that pass the filters
const tiles = new Map();

export function build(section) {
  page = section;
  filters = h('div', { class: 'side' });
  inner = h('div', { style: 'position:relative' });
  list = h('div', { class: 'grid', tabindex: 0, role: 'region', 'aria-label': 'Images', onscroll: draw }, inner);
  count = h('span', { id: 'count', role: 'status' });
  order = h('span', { class: 'bar', style: 'padding:0' });
  none = h('p', { class: 'empty' }, 'No image passes the filters. ', resetButton('reset-empty'));
  section.className = 'split';
  section.append(filters, h('div', { class: 'column' }, h('div', { class: 'bar' }, count, order), none, list));
  addEventListener('resize', draw);
}

/** Keys of the photos with the rock that the grid is limited to, or null. */
async function among() {
  if (!state.only) return null;
  const [terrain, rock] = rockOf(state.only);
  const found = new Set();
  for (const labels of await Promise.all([labelsOf(terrain, false), labelsOf(terrain, true)])) {
    for (let row = 0; row < labels.rows; row += 1) {
      if (labels.columns.rock[row] === rock) found.add(labels.values.key[labels.columns.key[row]]);
    }
  }
  return found;
}

export async function refresh(changed = new Set(['all'])) {
  if (![...changed].some((name) => name.startsWith('f.') || ['all', 'view', 'sort', 'down', 'only'].includes(name))) return;
  const keys = await among();
  const start = performance.now();
  shown = filtered(keys);
  const took = performance.now() - start;
  count.textContent = `${shown.length} of ${run.pictures.rows} images${state.only ? ` with rock ${state.only.split('.')[1]}` : ''}`;
  count.dataset.ms = took.toFixed(1);
  none.hidden = shown.length > 0;
  list.hidden = !none.hidden;
  renew(filters, () => [form()]);
  renew(order, () => [
    chooser('sort by', SORTS, state.sort, (sort) => set({ sort })),
    toggle('descending', Boolean(state.down), (on) => set({ down: on ? 1 : 0 })),
  ]);
  for (const tile of tiles.values()) tile.remove();
  tiles.clear();
  draw();
}

function draw() {
  if (!page || page.hidden) return;
  const room = list.clientWidth - EDGE, columns = Math.max(1, Math.floor(room / WIDE));
  inner.style.height = `${Math.ceil(shown.length / columns) * HIGH}px`;
  const first = Math.max(0, Math.floor(list.scrollTop / HIGH) - MARGIN) * columns;
  const end = Math.min(shown.length, (Math.ceil((list.scrollTop + list.clientHeight) / HIGH) + MARGIN) * columns);
  for (const [number, tile] of tiles) if (number < first || number >= end) { tile.remove(); tiles.delete(number); }
  for (let number = first; number < end; number += 1) {
    if (!tiles.has(number)) { tiles.set(number, tileOf(shown[number])); inner.append(tiles.get(number)); }
    const style = tiles.get(number).style;
    style.left = `${EDGE + Math.floor(((number % columns) * room) / columns)}px`;
    style.top = `${Math.floor(number / columns) * HIGH}px`;
  }
}

function tileOf(row) {
  const key = keyAt(row), domain = domainAt(row), { columns } = run.pictures;
  const value = (text, name) => (Number.isNaN(columns[name][row]) ? [] : [`${text} ${columns[name][row].toFixed(2)}`]);
  const values = [domain, ...value(domain === 'photo' ? 'IoU' : 'SSIM', 'score'), ...value('conf.', 'confidence')];
  const picture = h('img', { src: smallUrl(domain, key), alt: '', onload: () => brighten(picture) });
  return h('button', { type: 'button', class: 'tile', onclick: () => choose(row), 'data-key': key },
    picture, h('span', { text: key, title: key }), h('small', { text: values.join(', ') }));
}

/** Normalise the brightness of short exposures for display. */
function brighten(picture) {
  picture.style.filter = `brightness(${brightening(picture)})`;
}

export function choose(row) {
  const key = keyAt(row), domain = domainAt(row);
  const left = domain === 'photo' ? {} : { right: domain };
  set({ view: 'compare', key, ...left });
}

/** The photo of the grid with the most similar twin, and the domain of the twin; without twins the first image. */
export function first() {
  const { score } = run.pictures.columns, keys = new Set(shown.map(keyAt));
  const twins = [...run.rows.values()].filter((row) => score[row] > 0 && domainAt(row) !== 'photo' && keys.has(keyAt(row)) && has('photo', keyAt(row)));
  const best = twins.reduce((chosen, row) => (score[row] > score[chosen] ? row : chosen), twins[0] ?? shown[0]);
  return { key: keyAt(best), ...(twins.length && !state.right ? { right: domainAt(best) } : {}) };
}

/** Select the photo `by` steps further in the grid. */
export function step(by) {
  const photos = [...new Set(shown.map(keyAt))];
  if (!photos.length) return;
  const now = photos.indexOf(state.key);
  set({ key: photos[Math.min(photos.length - 1, Math.max(0, now + by))] });
}
