// Editor of boxes, with previews on the exposure bracket, in the other camera and under other Suns.

import { bracketOf, has, keyOf, known, nearestExposure, parts, pictureUrl, row, rowsOf, run, table } from './data.js';
import { Corrections, clipped, coco, dragged, grip } from './corrections.js';
import { chooser, h, renew, s, soon } from './dom.js';
import { crop, labels, outline } from './overlay.js';
import { unknown } from './filters.js';
import { set, state } from './state.js';
import { read, whiteOf } from './picture.js';

const EDGES = ['x0', 'y0', 'x1', 'y1'];

let controls = null, editor = null, panels = null, note = null, effects = null, corrections = null, opened = null, saveStatus = null;
let boxes = [], propagated = [], former = [], chosen = -1, near = true, drag = null, selections = 0, nextRun = null;

export function build(section) {
  opened = Corrections.open(showSaveStatus).then((found) => { corrections = found; return ''; }, (error) => error.message);
  addEventListener('beforeunload', (event) => { if (corrections?.unsaved.size) event.preventDefault(); });
  controls = h('div', { class: 'bar' });
  saveStatus = h('span', { role: 'status', id: 'save-status' });
  note = h('p', { class: 'empty', role: 'status' });
  editor = s('svg', { id: 'editor', tabindex: 0, role: 'application', 'aria-label': 'editor of boxes', style: 'width:100%;height:100%;touch-action:none' });
  panels = h('div', { class: 'panels', role: 'region', 'aria-label': 'Selected label in other photos', tabindex: 0 });
  nextRun = h('span', { role: 'status', id: 'next-run' });
  effects = h('div', { class: 'bar', id: 'effects' });
  section.append(h('div', { class: 'column' }, controls, h('div', { class: 'bar' }, saveStatus, nextRun), note, h('div', { class: 'work' }, h('div', { class: 'stage' }, editor), panels), effects));
  listen();
}

export const refresh = soon(async () => {
  const problem = await opened;
  const shown = !problem && known(state.key);
  note.hidden = shown;
  note.textContent = problem || unknown(state.key);
  controls.hidden = panels.parentElement.hidden = !shown;
  if (shown) {
    const key = state.key;
    propagated = (await labels(key, false)).map(({ kind, rock, ...rest }) => clipped({ kind, rock, ...Object.fromEntries(EDGES.map((edge) => [edge, rest[edge]])) }, run.about)).filter(Boolean);
    former = rowsOf(await changesOf(key), key).filter(({ change }) => change !== 'new');
    if (key !== state.key) return;
    const wanted = boxes[chosen];
    boxes = corrections.of(key) ?? propagated;
    chosen = boxes.indexOf(wanted);
    if (chosen < 0) chosen = boxes.findIndex((one) => wanted && one.kind === wanted.kind && one.rock === wanted.rock && one.rock >= 0);
    if (state.rock && boxes[chosen]?.rock !== rockNow()) chosen = boxes.findIndex((one) => one.rock === rockNow() && one.kind === state.kind);
    if (chosen < 0) chosen = boxes.findIndex((one) => one.rock === rockNow());
    drawAll();
    if (chosen >= 0 && document.activeElement === document.body) editor.focus({ preventScroll: true }); // for arrow keys
  }
  await drawEffects();
});

/** Labels of the photo's terrain that the last run with corrections changed. */
const changesOf = (key) => table(`data/changes/${parts(key).terrain}.arrow`);

function showSaveStatus() {
  saveStatus.textContent = corrections.message;
}

const rockNow = () => (state.rock.startsWith(`${parts(state.key).terrain}.`) ? Number(state.rock.split('.')[1]) : -2);

function drawAll() {
  drawControls();
  drawEditor();
  drawPanels();
}

function drawControls() {
  const now = corrections.of(state.key);
  const count = corrections.keys.length;
  renew(controls, () => [
    h('strong', { text: state.key }),
    h('span', { text: now ? 'corrected' : 'as propagated', id: 'corrected' }),
    h('span', { class: 'dim', id: 'confirms', text: `${now ? 'all' : 'an edit confirms all'} ${boxes.length} boxes ${now ? 'are annotations' : 'as annotations'}`,
      title: 'The next run uses all boxes of a corrected photo as annotations with confidence 1, also boxes that were not edited. Check them, and delete wrong boxes.' }),
    h('button', { type: 'button', text: near ? 'whole photo' : 'close up', onclick: () => { near = !near; drawAll(); } }),
    h('button', { type: 'button', text: 'new rock', onclick: () => add('rock') }),
    h('button', { type: 'button', text: 'new shadow', onclick: () => add('shadow') }),
    h('button', { type: 'button', text: 'delete box', disabled: chosen < 0, onclick: remove }),
    h('button', { type: 'button', text: 'undo', id: 'undo', disabled: !corrections.past.length, onclick: undo }),
    h('button', { type: 'button', text: 'revert photo', id: 'revert', disabled: !now, title: 'Discard the correction of this photo', onclick: () => { corrections.drop(state.key); showCorrections(); } }),
    h('button', { type: 'button', text: 'discard corrections', id: 'drop', disabled: !count, title: 'Discard the corrections of all photos', onclick: dropAll }),
    h('button', { type: 'button', id: 'download', text: `download corrections (${photos(count)})`, disabled: !count, onclick: download,
      title: 'COCO file: put it into a separate folder and set labels.corrections to this folder' }),
    ...(corrections.token ? [h('button', { type: 'button', id: 'prepare', text: 'prepare the next run', disabled: !count, onclick: prepareRun,
      title: 'Write an overlay of the configuration that applies the corrections, and show the command' })] : []),
  ]);
  showSaveStatus();
}

const photos = (count) => `${count} ${count === 1 ? 'photo' : 'photos'}`;

function undo() {
  const key = corrections.undo();
  selections += 1;
  if (key && key !== state.key) set({ key });
  else showCorrections();
}

async function prepareRun() {
  try {
    const { overlay, command } = await corrections.prepareRun();
    nextRun.replaceChildren(`${overlay} is written. Run `, h('code', { text: command }), ' in the folder of the run, then reload this page');
  } catch (error) { nextRun.textContent = error.message; }
}

function dropAll() {
  if (!confirm(`Discard the corrections of ${photos(corrections.keys.length)}?`)) return;
  corrections.dropAll();
  showCorrections();
}

/** Show the boxes of the corrections. */
function showCorrections() {
  boxes = corrections.of(state.key) ?? propagated;
  chosen = Math.min(chosen, boxes.length - 1);
  drawAll();
}

/** Change all boxes; consecutive changes with the same name `edit` are one step of undo. */
function change(next, edit = '') {
  corrections.put(state.key, next, edit);
  nextRun.textContent = '';
  boxes = next;
  drawAll();
}

function add(kind) {
  const { width, height } = run.about;
  const at = boxes[chosen] ?? { x0: width / 2 - 40, x1: width / 2 + 40, y0: height / 2 - 30, y1: height / 2 + 30 };
  const side = 60, x0 = Math.min(width - side, at.x1 + 8), y0 = Math.min(height - side, at.y0);
  const one = { kind, rock: -1, x0, y0, x1: x0 + side, y1: y0 + side };
  chosen = boxes.length;
  change([...boxes, one]);
  set({ rock: '' }); // the new box has no rock id
}

function remove() {
  const index = chosen;
  chosen = -1;
  change(boxes.filter((_, number) => number !== index));
}

function download() {
  const content = new Blob([JSON.stringify(coco(corrections.photos, run.about), null, 1)], { type: 'application/json' });
  const link = h('a', { href: URL.createObjectURL(content), download: `corrections_${run.about.run}.json` });
  link.click();
  URL.revokeObjectURL(link.href);
}

/** View box of the editor, pixels of the photo. */
function sight() {
  const { width, height } = run.about, one = boxes[chosen];
  if (!near || !one) return [0, 0, width, height];
  const side = Math.max(260, 3 * Math.max(one.x1 - one.x0, one.y1 - one.y0));
  return [(one.x0 + one.x1 - side) / 2, (one.y0 + one.y1 - side / 1.4) / 2, side, side / 1.4];
}

let bright = 1;
async function drawEditor() {
  const key = state.key, { width, height } = run.about;
  const domain = has('photo', key) ? 'photo' : run.about.domains[1];
  const url = pictureUrl(domain, key);
  if (!drag) editor.setAttribute('viewBox', sight().join(' '));
  editor.replaceChildren(
    s('image', { href: url, width, height, preserveAspectRatio: 'none', style: `filter:brightness(${bright})` }),
    ...boxes.map((one, number) => s('rect', {
      class: `box ${one.kind} ${number === chosen ? 'edited' : ''}`, x: one.x0, y: one.y0, width: one.x1 - one.x0, height: one.y1 - one.y0, 'data-number': number,
    }, s('title', { text: `${one.kind} ${one.rock < 0 ? '' : one.rock}` }))),
    ...former.map((one) => outline(one, `former ${one.kind}`)),
  );
  const picture = await read(url).catch(() => null);
  if (picture && key === state.key) {
    bright = (1 / whiteOf(picture)) ** (1 / 2.2);
    editor.firstChild.style.filter = `brightness(${bright})`;
  }
}

/** Photos of the same station: the bracket, the other camera, the other Suns. */
function siblings() {
  const fields = parts(state.key);
  const sameExposure = (change) => {
    const changed = { ...fields, ...change };
    const exposure = nearestExposure(bracketOf(keyOf(changed)), fields.exposure);
    return Number.isFinite(exposure) ? [keyOf({ ...changed, exposure })] : [];
  };
  const bracket = (run.brackets.get(bracketOf(state.key)) ?? []).map((exposure) => keyOf({ ...fields, exposure }));
  return [
    ...bracket.filter((key) => key !== state.key).map((key) => [key, 'exposure', true]),
    ...sameExposure({ camera: fields.camera === 'L' ? 'R' : 'L' }).map((key) => [key, 'other camera', false]),
    ...run.about.suns.filter((azimuth) => azimuth !== fields.azimuth).flatMap((azimuth) => sameExposure({ azimuth }).map((key) => [key, `Sun ${azimuth}`, true])),
  ];
}

let drawn = 0;
async function drawPanels() {
  const one = boxes[chosen], turn = (drawn += 1);
  if (!one) { panels.replaceChildren(h('p', { class: 'note', text: 'Select a box to show it in the photos of the exposure bracket, of the other camera and of other Suns.' })); return; }
  const before = propagated.find((other) => other.rock === one.rock && other.kind === one.kind && one.rock >= 0);
  const found = await Promise.all(siblings().map(async ([key, what, sameCamera]) => {
    const own = await labels(key, false);
    const label = own.find((other) => other.rock === one.rock && other.kind === one.kind && one.rock >= 0);
    return [key, what, label, expected(one, before, label, sameCamera && (one.kind === 'rock' || what === 'exposure'))];
  }));
  if (turn !== drawn) return;
  panels.replaceChildren(...found.map(([key, what, label, preview]) => {
    const at = preview ?? label ?? one;
    const domain = has('photo', key) ? 'photo' : run.about.domains[1];
    const marks = [label ? outline(label, one.kind) : null, preview ? outline(preview, 'preview') : null].filter(Boolean);
    return h('figure', {}, crop(pictureUrl(domain, key), at, marks),
      h('figcaption', {}, `${what}: `, h('button', { type: 'button', text: key, onclick: () => set({ key }) }), label ? '' : ' no label'));
  }));
}

/** Expected box in another photo: the same for the same camera, displaced by the same amount for the other camera. */
function expected(one, before, label, still) {
  if (still) return one;
  if (!label || !before) return null;
  return Object.fromEntries(EDGES.map((edge) => [edge, label[edge] + one[edge] - before[edge]]));
}

function listen() {
  const at = (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(editor.getScreenCTM().inverse());
    return [point.x, point.y, 7 / editor.getScreenCTM().a];
  };
  editor.addEventListener('pointerdown', (event) => {
    const [x, y, reach] = at(event);
    let held = chosen >= 0 ? grip(boxes[chosen], x, y, reach) : null;
    if (held === null) {
      const number = Number(event.target.dataset?.number ?? -1);
      chosen = number;
      selections += 1;
      const one = boxes[number];
      drawAll();
      if (one) set({ rock: one.rock >= 0 ? `${parts(state.key).terrain}.${one.rock}` : '', kind: one.kind });
      return;
    }
    drag = { x, y, held, box: boxes[chosen] };
    editor.setPointerCapture(event.pointerId);
  });
  editor.addEventListener('pointermove', (event) => {
    if (!drag) return;
    const [x, y] = at(event);
    const moved = dragged(drag.box, drag.held, x - drag.x, y - drag.y, run.about);
    boxes = boxes.map((one, number) => (number === chosen ? moved : one));
    drawEditor();
  });
  editor.addEventListener('pointerup', () => {
    if (!drag) return;
    const { box } = drag, moved = EDGES.some((edge) => boxes[chosen][edge] !== box[edge]);
    drag = null;
    if (moved) change(boxes);
  });
  editor.addEventListener('keydown', (event) => {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (chosen >= 0 && by) {
      change(boxes.map((one, number) => (number === chosen ? dragged(one, event.shiftKey ? 'es' : '', ...by, run.about) : one)), `${event.shiftKey ? 'resize' : 'move'} ${chosen} ${selections}`);
    } else if (chosen >= 0 && event.key === 'Delete') remove();
    else return;
    event.preventDefault();
    event.stopPropagation();
  });
}

/** Show the effect of the last run with corrections, and the labels that depend on a seed, if the run has this table. */
async function drawEffects() {
  const { seeds: all, undone } = run.about;
  const seed = all.includes(state.seed) ? state.seed : '';
  const changes = seed && undone.includes(seed) ? await table(`data/undone/${seed}.arrow`) : null;
  const corrected = await Promise.all(run.about.terrains.map((terrain) => table(`data/changes/${terrain}.arrow`)));
  renew(effects, () => [
    ...(corrected.some(({ rows }) => rows) ? effectOf(corrected, 'correction-effect', 'labels changed by the last corrections (dotted: former box)') : []),
    chooser('labels that depend on the seed', [['', 'none'], ...all], seed, (value) => set({ seed: value })),
    ...(seed && !changes ? [h('span', {}, 'run ', h('code', { text: `polarsim undo ${seed} --run ${run.about.run}` }), ' and start polarsim explore again')] : []),
    ...(changes ? effectOf([changes], 'seed-effect', 'labels without this seed') : []),
  ]);
}

const EFFECTS = { gone: 'removed', moved: 'moved', new: 'new' };

/** Number of changed labels in all photos, and a list of these photos. */
function effectOf(tables, id, title) {
  const photos = new Map();
  for (const changes of tables) {
    for (let k = 0; k < changes.rows; k += 1) {
      const { key, change: effect, moved_px: shift } = row(changes, k);
      if (!photos.has(key)) photos.set(key, { counts: {}, shift: 0 });
      const photo = photos.get(key);
      photo.counts[effect] = (photo.counts[effect] ?? 0) + 1;
      if (shift > photo.shift) photo.shift = shift;
    }
  }
  const list = ({ counts, shift }) => Object.entries(counts).map(([effect, count]) => `${count} ${EFFECTS[effect]}${effect === 'moved' ? ` (up to ${shift.toFixed(0)} px)` : ''}`).join(', ');
  const total = { counts: {}, shift: 0 };
  for (const { counts, shift } of photos.values()) {
    for (const [effect, count] of Object.entries(counts)) total.counts[effect] = (total.counts[effect] ?? 0) + count;
    total.shift = Math.max(total.shift, shift);
  }
  return [
    h('span', { id, text: `${title}, in ${photos.size} ${photos.size === 1 ? 'photo' : 'photos'}: ${list(total) || 'no change'}` }),
    chooser('in', [['', 'a photo'], ...[...photos].map(([key, photo]) => [key, `${key}: ${list(photo)}`])], photos.has(state.key) ? state.key : '', (key) => key && set({ key })),
  ];
}
