// Filters of the table of images.

import { FIELDS, RANGES, set, state } from './state.js';
import { run } from './data.js';
import { h } from './dom.js';

/** Sorted distinct values of a field with their codes. */
export function valuesOf(field) {
  const { columns, values } = run.pictures;
  if (values[field]) return values[field].map((value, code) => [value, code]).sort(byOrder);
  return [...new Set(columns[field])].sort((a, b) => a - b).map((value) => [String(value), value]);
}

const byOrder = ([a], [b]) => (Number(a) - Number(b)) || String(a).localeCompare(String(b));

/** Rows that pass the filters of the state; `among` limits the keys, null for all keys. */
export function filtered(among = null) {
  const { columns, rows } = run.pictures;
  const tests = FIELDS.filter((field) => state[`f.${field}`]).map((field) => {
    const wanted = new Set(state[`f.${field}`].split(','));
    const codes = new Set(valuesOf(field).filter(([value]) => wanted.has(value || 'none')).map(([, code]) => code));
    return [columns[field], codes];
  });
  const ranges = RANGES.filter((field) => state[`f.${field}`]).map((field) => {
    const [low, high] = state[`f.${field}`].split('..').map((text, end) => (text === '' ? (end ? Infinity : -Infinity) : Number(text)));
    return [columns[field], low, high];
  });
  const keys = among && new Set(run.pictures.values.key.map((key, code) => [key, code]).filter(([key]) => among.has(key)).map(([, code]) => code));
  const matching = [];
  for (let row = 0; row < rows; row += 1) {
    if (tests.every(([column, allowed]) => allowed.has(column[row]))
      && ranges.every(([column, low, high]) => column[row] >= low && column[row] <= high)
      && (!keys || keys.has(columns.key[row]))) matching.push(row);
  }
  return sorted(matching);
}

function sorted(rows) {
  const column = run.pictures.columns[state.sort];
  if (state.sort === 'key' || !column) return state.down ? rows.reverse() : rows;
  const sign = state.down ? -1 : 1, rank = (value) => (Number.isNaN(value) ? Infinity : sign * value); // without a value: last
  return rows.sort((a, b) => (rank(column[a]) === rank(column[b]) ? a - b : rank(column[a]) - rank(column[b])));
}

/** Message for a view without an image. */
export const unknown = (key) => (key ? `This run has no image ${key}. Select an image in Photos.` : 'No image passes the filters of the grid. "All images" in Photos resets the filters.');

const reset = () => set(Object.fromEntries([...FIELDS, ...RANGES].map((field) => [`f.${field}`, '']).concat([['only', '']])));

/** Button that resets all filters. */
export const resetButton = (id) => h('button', { type: 'button', id, onclick: reset, text: 'All images' });

const MEANING = {
  score: 'photos: mean IoU of the labels with the true boxes; twins: similarity to the photo (SSIM), at one exposure per bracket',
  confidence: 'mean over the labels of an image',
};
const NAMES = { exposure_ms: 'exposure, ms', light: 'rover light', azimuth: 'Sun azimuth' };

/** The form of all filters. */
export function form() {
  const boxes = FIELDS.map((field) => {
    const values = valuesOf(field);
    const wanted = new Set(state[`f.${field}`].split(',').filter(Boolean));
    if (values.length < 2 && !wanted.size) return null; // no choice
    return h('fieldset', {}, h('legend', { text: NAMES[field] ?? field }), values.map(([value]) => {
      const name = value || 'none';
      const box = h('input', { type: 'checkbox', name: field, value: name, checked: wanted.has(name), onchange: () => {
        if (box.checked) wanted.add(name); else wanted.delete(name);
        set({ [`f.${field}`]: [...wanted].join(',') });
      } });
      return h('label', {}, box, name);
    }));
  });
  const ranges = RANGES.map((field) => {
    const ends = (state[`f.${field}`] || '..').split('..');
    const inputs = ['minimum', 'maximum'].map((end, index) => h('input', {
      type: 'number', min: 0, max: 1, step: 0.01, value: ends[index] ?? '', 'aria-label': `${end} ${field}`, name: `${field}-${end}`,
      onchange: (event) => {
        ends[index] = event.target.value;
        set({ [`f.${field}`]: ends.join('..') === '..' ? '' : ends.join('..') });
      },
    }));
    return h('fieldset', {}, h('legend', { text: field }), inputs[0], ' to ', inputs[1], h('p', { class: 'note', text: MEANING[field] }));
  });
  return h('form', { onsubmit: (event) => event.preventDefault() }, boxes, ranges, resetButton('reset'));
}
