// What is shown, kept in the address: every state is a link.

const defaults = {
  view: 'photos', key: '', left: 'photo', right: '', split: 50, ev: 0, auto: 1, show: 'bil', labels: 'photo',
  rock: '', detector: '', confidence: 0.25, colour: 'lit', terrain: '', camera: '', orbit: '', drive: '', sight: '',
  look: '', frame: 0, kind: 'rock', seed: '', lamps: '', sort: 'key', only: '',
};
export const FIELDS = ['domain', 'terrain', 'position', 'light', 'azimuth', 'camera', 'exposure_ms', 'defect'];
export const RANGES = ['score', 'confidence'];
for (const field of FIELDS) defaults[`f.${field}`] = '';
for (const field of RANGES) defaults[`f.${field}`] = '';

export const state = { ...defaults };
const listeners = [];

/** Calls `listener(changed names)` after every change. */
export const onChange = (listener) => listeners.push(listener);

/** Change some of the state. */
export function set(changes) {
  const changed = new Set();
  for (const [name, value] of Object.entries(changes)) {
    if (name in defaults && state[name] !== value) { state[name] = value; changed.add(name); }
  }
  if (!changed.size) return;
  writeAddress();
  for (const listener of listeners) listener(changed);
}

/** The state as the part of an address behind `#`; only what is not as usual. */
export function asText() {
  const told = Object.keys(defaults).filter((name) => state[name] !== defaults[name]);
  return told.map((name) => `${name}=${encodeURIComponent(state[name])}`).join('&');
}

/** What an address says; names and kinds of values that are not known are passed over. */
export function parse(text) {
  const found = { ...defaults };
  for (const part of text.replace(/^#/, '').split('&')) {
    const [name, value = ''] = part.split('=');
    if (!(name in defaults)) continue;
    let told = '';
    try { told = decodeURIComponent(value); } catch { continue; }
    if (typeof defaults[name] !== 'number') found[name] = told;
    else if (Number.isFinite(Number(told))) found[name] = Number(told);
  }
  return found;
}

let pending = 0;
function writeAddress() { // browsers refuse more than a few hundred changes of the address at a time
  clearTimeout(pending);
  pending = setTimeout(() => history.replaceState(null, '', `#${asText()}`), 120);
}

/** Take the state of the address, now and whenever it is edited. */
export function followAddress() {
  Object.assign(state, parse(location.hash));
  addEventListener('hashchange', () => set(parse(location.hash)));
}

/** Whether a mark is drawn: b boxes, m masks, i rock ids, l lines, p predictions. */
export const shows = (mark) => state.show.includes(mark);
export const switchMark = (mark) => set({ show: shows(mark) ? state.show.replace(mark, '') : state.show + mark });
