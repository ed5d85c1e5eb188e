// Predictions of detectors at a confidence threshold: counts of correct and missed labels, list of false positives.

import { has, labelsOf, parts, pictureUrl, row, run, spans, table } from './data.js';
import { chooser, h, renew, slider, soon } from './dom.js';
import { crop, outline } from './overlay.js';
import { set, shows, state } from './state.js';

const MAX_ITEMS = 120; // of the list
const FALSE_POSITIVES = 'false positives (rocks only): no overlap with a rock label, centre in a tile without rock labels, as in tables/false_positives';
const SORTS = [['confidence', 'confidence, highest first'], ['size', 'size, largest first'], ['key', 'photo']];

let controls = null, metrics = null, list = null, order = 'confidence';

export function build(section) {
  controls = h('div', { class: 'bar' });
  metrics = h('div', { class: 'bar', role: 'status', id: 'counts' });
  list = h('div', { class: 'list', role: 'region', 'aria-label': 'False positives', tabindex: 0 });
  section.append(h('div', { class: 'column' }, controls, metrics, h('div', { class: 'stage', style: 'background:none' }, list)));
}

const nameNow = () => state.detector || run.about.predictions[0] || '';
const domainOf = (name) => { const domain = name.slice(name.lastIndexOf('_on_') + 4); return run.about.domains.includes(domain) ? domain : 'photo'; };

export const refresh = soon(async () => {
  const name = nameNow();
  if (!name) { list.replaceChildren(h('p', { class: 'empty', text: 'This run has no predictions.' })); return; }
  renew(controls, () => [
    chooser('detector', run.about.predictions, name, (detector) => set({ detector })),
    chooser('kind', ['rock', 'shadow'], state.kind, (kind) => set({ kind })),
    slider('confidence', { min: 0.05, max: 0.99, step: 0.01, value: state.confidence, shown: (value) => `≥ ${value.toFixed(2)}` }, (confidence) => set({ confidence })),
    chooser('sort by', SORTS, order, (value) => { order = value; refresh(); }),
  ]);
  const predictions = await table(`data/predictions/${name}.arrow`);
  await count(predictions, name);
  drawList(predictions, domainOf(name));
});

/** Rows of the selected kind above the confidence threshold. */
function sure(predictions) {
  const { confidence, kind } = predictions.columns, code = predictions.values.kind.indexOf(state.kind), found = [];
  for (let k = 0; k < predictions.rows; k += 1) if (kind[k] === code && confidence[k] >= state.confidence) found.push(k);
  return found;
}

async function count(predictions, name) {
  const rows = sure(predictions);
  const right = rows.filter((k) => predictions.columns.right[k]).length;
  const wrong = rows.filter((k) => predictions.columns.false_positive[k]).length;
  const keys = [...spans(predictions).keys()];
  const tables = await Promise.all([...new Set(keys.map((key) => parts(key).terrain))].map((terrain) => labelsOf(terrain, domainOf(name) !== 'photo')));
  let labelled = 0;
  for (const labels of tables) {
    const code = labels.values.kind.indexOf(state.kind), own = spans(labels);
    for (const key of keys) {
      const [start, end] = own.get(key) ?? [0, 0];
      for (let k = start; k < end; k += 1) labelled += labels.columns.kind[k] === code ? 1 : 0;
    }
  }
  const share = (part, of) => (of ? (part / of).toFixed(3) : '-');
  metrics.replaceChildren(...[
    `${keys.length} photos`, `${rows.length} predictions`, `${right} correct (IoU 0.5)`, `${labelled - right} of ${labelled} labels missed`,
    `precision ${share(right, rows.length)}`, `recall ${share(right, labelled)}`, state.kind === 'rock' ? `${wrong} false positives` : FALSE_POSITIVES,
  ].map((text) => h('span', { text, title: text.endsWith('false positives') ? FALSE_POSITIVES : '' })));
}

function drawList(predictions, domain) {
  const { x0, y0, x1, y1, confidence, false_positive: wrong } = predictions.columns;
  const size = (k) => (x1[k] - x0[k]) * (y1[k] - y0[k]);
  const by = { confidence: (a, b) => confidence[b] - confidence[a], size: (a, b) => size(b) - size(a), key: (a, b) => a - b }[order];
  const rows = sure(predictions).filter((k) => wrong[k]).sort(by);
  const items = rows.slice(0, MAX_ITEMS).map((k) => {
    const one = row(predictions, k);
    return h('button', {
      type: 'button', class: 'crop', 'aria-label': `${one.key}, confidence ${one.confidence.toFixed(2)}`,
      onclick: () => set({ view: 'compare', key: one.key, detector: nameNow(), show: shows('p') ? state.show : `${state.show}p`, ...(domain === 'photo' ? {} : { right: domain }) }),
    }, has(domain, one.key) ? crop(pictureUrl(domain, one.key), one, outline(one, 'seen false')) : null,
    h('small', { text: `${one.confidence.toFixed(2)}  ${one.key}` }));
  });
  list.replaceChildren(...(items.length ? items : [h('p', { class: 'empty', text: state.kind === 'rock' ? 'No false positive above this confidence.' : 'Shadows are not counted as false positives.' })]));
}
