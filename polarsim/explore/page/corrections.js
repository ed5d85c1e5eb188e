// Corrected boxes by photo: saved by the local server, undone, downloaded as COCO.

const KINDS = ['rock', 'shadow'];
const URL_OF = 'data/corrections';
const MIN_SIDE_PX = 0.01; // minimum side of a box, as in the server
const MAX_UNDO = 200; // steps

export class Corrections {
  /** The first argument is the content of data/corrections.json; `notify` is called after every change of `message`. */
  constructor({ photos, folder, token, version }, notify) {
    Object.assign(this, { photos, folder, token, version, notify, past: [], unsaved: new Set(), sending: null, problem: '' });
    this.#recall();
  }

  /** Read the corrections of the run. */
  static async open(notify) {
    const answer = await fetch(`${URL_OF}.json`, { cache: 'no-store' });
    if (!answer.ok) throw new Error(`corrections cannot be read: ${(await answer.text()).trim()}`);
    return new Corrections(await answer.json(), notify);
  }

  get keys() { return Object.keys(this.photos).sort(); }

  of(key) { return this.photos[key]; }

  /** Text on the state of saving. */
  get message() {
    const count = this.unsaved.size, photos = `${count} ${count === 1 ? 'photo' : 'photos'}`;
    if (!this.token) return count ? `${photos} not saved: this page has no server. Download the corrections before closing the page` : '';
    if (this.problem) return `${photos} not saved: ${this.problem}`;
    if (count) return 'saving ...';
    return this.keys.length ? `saved in ${this.folder}` : '';
  }

  /** Replace all boxes of a photo. Consecutive changes with the same name `edit` are one step of undo. */
  put(key, boxes, edit = '') { this.#change({ [key]: boxes }, edit && `${key} ${edit}`); }

  /** Discard the correction of a photo. */
  drop(key) { this.#change({ [key]: null }); }

  /** Discard the corrections of all photos. */
  dropAll() { this.#change(Object.fromEntries(this.keys.map((key) => [key, null]))); }

  /** Undo the last step; return the key of a photo that it changed, or an empty string. */
  undo() {
    const step = this.past.pop();
    if (!step) return '';
    this.#replace(step.before);
    return Object.keys(step.before)[0];
  }

  /** Change the boxes of some photos; null: without a correction. */
  #change(photos, edit = '') {
    if (!edit || this.past.at(-1)?.edit !== edit) {
      const before = Object.fromEntries(Object.keys(photos).map((key) => [key, this.photos[key] ?? null]));
      this.past.push({ before, edit });
      if (this.past.length > MAX_UNDO) this.past.shift();
    }
    this.#replace(photos);
  }

  #replace(photos) {
    const all = { ...this.photos, ...photos };
    this.photos = Object.fromEntries(Object.entries(all).filter(([, boxes]) => boxes));
    for (const key of Object.keys(photos)) this.unsaved.add(key);
    this.save();
  }

  /** Send all changed photos to the server; photos refused by the server remain unsaved. */
  save() {
    if (this.token) this.sending ??= this.#sendAll().finally(() => { this.sending = null; this.notify(); });
    this.notify();
    return this.sending;
  }

  /** Write the overlay of the next run, after all changes are saved; return its path and the command. */
  async prepareRun() {
    await this.sending;
    if (this.unsaved.size) throw new Error(this.message);
    return this.#send('data/next_run.json', 'PUT', {});
  }

  async #sendAll() {
    this.problem = '';
    const refused = new Set();
    for (;;) {
      const key = [...this.unsaved].find((one) => !refused.has(one));
      if (key === undefined) break;
      const boxes = this.photos[key];
      try {
        const { version } = await this.#send(`${URL_OF}/${key}`, boxes ? 'PUT' : 'DELETE', boxes);
        this.version = version;
        if (this.photos[key] === boxes) this.unsaved.delete(key);
      } catch (error) {
        this.problem = error.message;
        refused.add(key);
      }
    }
    this.#remember();
  }

  async #send(url, method, content) {
    const headers = { 'X-Polarsim-Token': this.token, 'Content-Type': 'application/json' };
    let answer;
    try {
      answer = await fetch(url, { method, headers, ...(content ? { body: JSON.stringify(content) } : {}) });
    } catch { throw new Error('the server does not respond. Download the corrections'); }
    if (answer.status === 403) throw new Error('the server was restarted. Download the corrections, then reload the page');
    if (!answer.ok) throw new Error((await answer.text()).trim());
    return answer.json();
  }

  /** Store the steps of undo for a reload of the page in this tab. */
  #remember() {
    try {
      sessionStorage.setItem(`undo ${this.folder}`, JSON.stringify({ version: this.version, past: this.past }));
    } catch { /* storage is full or disabled: undo reaches back to the next reload */ }
  }

  /** Restore the steps of undo, unless another program or tab has changed the corrections. */
  #recall() {
    if (!this.token) return;
    const { version, past } = JSON.parse(sessionStorage.getItem(`undo ${this.folder}`) ?? '{}');
    if (version === this.version) this.past = past;
  }
}

/** The part of a box inside the photo, or null. */
export function clipped(box, { width, height }) {
  const part = { ...box, x0: Math.max(0, box.x0), y0: Math.max(0, box.y0), x1: Math.min(width, box.x1), y1: Math.min(height, box.y1) };
  return Math.min(part.x1 - part.x0, part.y1 - part.y0) >= MIN_SIDE_PX ? part : null;
}

/** COCO file for `labels.corrections` with all boxes of every corrected photo. */
export function coco(photos, { width, height }) {
  const keys = Object.keys(photos).sort();
  const annotations = keys.flatMap((key, image) => photos[key].map((one) => ({
    image_id: image + 1, category_id: KINDS.indexOf(one.kind) + 1, iscrowd: 0, segmentation: [],
    bbox: [one.x0, one.y0, one.x1 - one.x0, one.y1 - one.y0].map((value) => Math.round(value * 1000) / 1000),
    area: (one.x1 - one.x0) * (one.y1 - one.y0), rock: one.rock,
  })));
  return {
    info: { description: 'Corrections made in polarsim explore' }, licenses: [],
    categories: KINDS.map((name, index) => ({ id: index + 1, name, supercategory: 'terrain' })),
    images: keys.map((key, index) => ({ id: index + 1, file_name: `${key}.png`, width, height })),
    annotations: annotations.map((one, index) => ({ id: index + 1, ...one })),
  };
}

/**
 * The box after dragging the edges in `grip` (letters w e n s, or '' for the box) by (dx, dy) pixels. The result is
 * inside the photo and at least a pixel wide and high.
 */
export function dragged(box, grip, dx, dy, { width, height }) {
  const within = (value, low, high) => Math.max(low, Math.min(high, value));
  const moved = { ...box };
  if (grip === '') {
    const right = within(dx, -box.x0, width - box.x1), down = within(dy, -box.y0, height - box.y1);
    return { ...moved, x0: box.x0 + right, x1: box.x1 + right, y0: box.y0 + down, y1: box.y1 + down };
  }
  const edge = (low, high, first, second, by, most) => {
    if (grip.includes(first)) moved[low] = within(box[low] + by, 0, most);
    if (grip.includes(second)) moved[high] = within(box[high] + by, 0, most);
    if (moved[high] < moved[low]) [moved[low], moved[high]] = [moved[high], moved[low]];
    if (moved[high] - moved[low] < 1) [moved[low], moved[high]] = moved[high] < most ? [moved[low], moved[low] + 1] : [most - 1, most];
  };
  edge('x0', 'x1', 'w', 'e', dx, width);
  edge('y0', 'y1', 'n', 's', dy, height);
  return moved;
}

/** The edges of a box within `reach` of a point (letters w e n s), '' inside the box, null outside. */
export function grip(box, x, y, reach) {
  const near = (a, b) => Math.abs(a - b) <= reach;
  if (x < box.x0 - reach || x > box.x1 + reach || y < box.y0 - reach || y > box.y1 + reach) return null;
  const across = near(x, box.x0) ? 'w' : near(x, box.x1) ? 'e' : '';
  return (near(y, box.y0) ? 'n' : near(y, box.y1) ? 's' : '') + across;
}
