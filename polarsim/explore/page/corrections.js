// Corrected boxes by photo: saved by the local server, undone, downloaded as COCO.

const KINDS = ['rock', 'shadow'];
const URL_OF = 'data/corrections';
const MIN_SIDE_PX = 0.01; // minimum side of a box, as in the server

export class Corrections {
  /** The first argument is the content of data/corrections.json; `notify` is called after every change of `message`. */
  constructor({ photos, folder, token }, notify) {
    Object.assign(this, { photos, folder, token, notify, past: [], unsaved: new Set(), sending: null, problem: '' });
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
    return this.keys.length ? `saved in ${this.folder}: set labels.corrections to this folder and run the workflow again` : '';
  }

  /** Replace all boxes of a photo; can be undone. */
  put(key, boxes) { this.#change({ ...this.photos, [key]: boxes }); }

  /** Discard the correction of a photo. */
  drop(key) {
    const { [key]: _, ...remaining } = this.photos;
    this.#change(remaining);
  }

  /** Discard the corrections of all photos. */
  dropAll() { this.#change({}); }

  undo() {
    if (!this.past.length) return false;
    this.#replace(this.past.pop());
    return true;
  }

  #change(photos) {
    this.past.push(this.photos);
    if (this.past.length > 200) this.past.shift();
    this.#replace(photos);
  }

  #replace(photos) {
    const before = this.photos;
    this.photos = photos;
    for (const key of new Set([...Object.keys(before), ...Object.keys(photos)])) if (before[key] !== photos[key]) this.unsaved.add(key);
    this.save();
  }

  /** Send all changed photos to the server; photos refused by the server remain unsaved. */
  save() {
    if (this.token) this.sending ??= this.#sendAll().finally(() => { this.sending = null; this.notify(); });
    this.notify();
    return this.sending;
  }

  async #sendAll() {
    this.problem = '';
    const refused = new Set();
    for (;;) {
      const key = [...this.unsaved].find((one) => !refused.has(one));
      if (key === undefined) return;
      const boxes = this.photos[key];
      try {
        await this.#send(key, boxes);
        if (this.photos[key] === boxes) this.unsaved.delete(key);
      } catch (error) {
        this.problem = error.message;
        refused.add(key);
      }
    }
  }

  async #send(key, boxes) {
    const headers = { 'X-Polarsim-Token': this.token, 'Content-Type': 'application/json' };
    const request = boxes ? { method: 'PUT', headers, body: JSON.stringify(boxes) } : { method: 'DELETE', headers };
    let answer;
    try { answer = await fetch(`${URL_OF}/${key}`, request); } catch { throw new Error('the server does not respond. Download the corrections'); }
    if (answer.status === 403) throw new Error('the server was restarted. Download the corrections, then reload the page');
    if (!answer.ok) throw new Error((await answer.text()).trim());
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
