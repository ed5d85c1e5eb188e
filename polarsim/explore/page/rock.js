// Panel of the selected rock: table values and crops of labels.

import { bracketOf, labelsOf, parts, pictureUrl, rockOf, row, run, spans, table } from './data.js';
import { h } from './dom.js';
import { crop, outline } from './overlay.js';
import { set, state } from './state.js';

const MAX_CROPS = 48;

let panel = null;
export const build = (aside) => { panel = aside; };

export async function refresh() {
  panel.hidden = !state.rock;
  if (!state.rock) return;
  const selected = state.rock, [terrain, rock] = rockOf(selected);
  const [facts, labels] = await Promise.all([table(`data/rocks/${terrain}.arrow`), labelsOf(terrain, false)]);
  if (selected !== state.rock) return;
  const rows = rowsOfRock(labels, rock);
  const brackets = byBracket(rows);
  const photos = new Set(rows.map((one) => one.key)).size;
  panel.replaceChildren(
    h('h2', { text: `Rock ${rock} of terrain ${terrain}` }),
    h('div', { class: 'bar', style: 'padding:0 0 6px' },
      h('button', { type: 'button', text: 'in 3-D', onclick: () => set({ view: 'terrain', terrain: String(terrain) }) }),
      h('button', { type: 'button', text: `in ${photos} photos`, id: 'rock-photos', onclick: () => set({ view: 'photos', only: selected, 'f.terrain': '' }) }),
      h('button', { type: 'button', text: 'close', onclick: () => set({ rock: '' }) })),
    h('h3', { text: `Labels: ${rows.length} in ${photos} photos; a photo of each of ${brackets.length} brackets:` }),
    h('div', { class: 'strip' }, brackets.slice(0, MAX_CROPS).map((one) => h('button', {
      type: 'button', class: 'crop', title: `${one.key}, confidence ${one.confidence.toFixed(2)}, ${one.source}`,
      'aria-label': one.key, onclick: () => set({ view: 'compare', key: one.key }),
    }, run.rows.has(`photo/${one.key}`) ? crop(pictureUrl('photo', one.key), one, outline(one, one.kind)) : null,
    h('small', { text: bracketOf(one.key).slice(3) })))),
    h('h3', { text: 'Tables' }),
    factsOf(facts, rock),
  );
}

/** Rows of the labels of a rock and its shadow. */
function rowsOfRock(labels, rock) {
  const rows = [];
  for (const [start, end] of spans(labels).values()) {
    for (let index = start; index < end; index += 1) if (labels.columns.rock[index] === rock) rows.push(row(labels, index));
  }
  return rows;
}

/** A label per bracket: preferably of the rock, at the exposure nearest to 256 ms. */
function byBracket(rows) {
  const best = new Map();
  const off = (one) => (one.kind === 'rock' ? 0 : 100) + Math.abs(Math.log2(parts(one.key).exposure / 256));
  for (const one of rows) {
    const name = bracketOf(one.key);
    if (!best.has(name) || off(one) < off(best.get(name))) best.set(name, one);
  }
  return [...best.values()];
}

function factsOf(facts, rock) {
  const index = facts.columns.rock ? facts.columns.rock.indexOf(rock) : -1;
  if (index < 0) return h('p', { class: 'note', text: 'The tables of the run do not contain this rock.' });
  const values = row(facts, index);
  const text = (value) => (typeof value === 'number' ? (Number.isInteger(value) ? String(value) : Number(value.toPrecision(4)).toString()) : value);
  return h('table', {}, h('tbody', {}, Object.entries(values)
    .filter(([name, value]) => name !== 'rock' && value !== '' && value !== 'nan' && !Number.isNaN(value))
    .map(([name, value]) => h('tr', {}, h('th', { scope: 'row', text: name }), h('td', { text: text(value) })))));
}
