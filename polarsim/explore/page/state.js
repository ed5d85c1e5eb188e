// State of the page, stored in the address, so that every state has a link.

const defaults = {
  view: 'photos', key: '', left: 'photo', right: '', split: 50, ev: 0, auto: 1, show: 'bil', labels: 'photo',
  rock: '', detector: '', confidence: 0.25, colour: 'lit', terrain: '', camera: '', orbit: '', drive: '', sight: '',
  look: '', frame: 0, kind: 'rock', seed: '', lamps: '', sort: 'key', down: 0, only: '',
};
export const FIELDS = ['domain', 'terrain', 'position', 'light', 'azimuth', 'camera', 'exposure_ms', 'defect'];
export const RANGES = ['score', 'confidence'];
for (const field of FIELDS) defaults[`f.${field}`] = '';
for (const field of RANGES) defaults[`f.${field}`] = '';

export const state = { ...defaults };
const listeners = [];

/** Register `listener(changed names)`, called after every change. */
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

/** The state as the fragment of an address; default values are omitted. */
export function asText() {
  const changed = Object.keys(defaults).filter((name) => state[name] !== defaults[name]);
  return changed.map((name) => `${name}=${encodeURIComponent(state[name])}`).join('&');
}

/** Parse the fragment of an address; unknown names and invalid values are ignored. */
export function parse(text) {
  const parsed = { ...defaults };
  for (const part of text.replace(/^#/, '').split('&')) {
    const [name, value = ''] = part.split('=');
    if (!(name in defaults)) continue;
    let decoded = '';
    try { decoded = decodeURIComponent(value); } catch { continue; }
    if (typeof defaults[name] !== 'number') parsed[name] = decoded;
    else if (Number.isFinite(Number(decoded))) parsed[name] = Number(decoded);
  }
  return parsed;
}

let pending = 0;
function writeAddress() { // browsers refuse more than a few hundred changes of the address at a time
  clearTimeout(pending);
  pending = setTimeout(() => history.replaceState(null, '', `#${asText()}`), 120);
}

/** Set the state from the address, now and after every edit of the address. */
export function followAddress() {
  Object.assign(state, parse(location.hash));
  addEventListener('hashchange', () => set(parse(location.hash)));
}

/** Whether a mark is drawn: b boxes, m masks, i rock ids, l lines, p predictions. */
export const shows = (mark) => state.show.includes(mark);
export const switchMark = (mark) => set({ show: shows(mark) ? state.show.replace(mark, '') : state.show + mark });
