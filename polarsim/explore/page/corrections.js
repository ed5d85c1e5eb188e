// Boxes that a person put right, photo by photo: saved by the server that sent the page, undone, downloaded as COCO.

const KINDS = ['rock', 'shadow'];
const URL_OF = 'data/corrections';
const LEAST_PX = 0.01; // side of a box, as the server has it

export class Corrections {
  /** `about` is the content of data/corrections.json; `tell` is called after every change of `message`. */
  constructor({ photos, folder, token }, tell) {
    Object.assign(this, { photos, folder, token, tell, past: [], unsaved: new Set(), sending: null, problem: '' });
  }

  /** Read the corrections of the run. */
  static async open(tell) {
    const answer = await fetch(`${URL_OF}.json`, { cache: 'no-store' });
    if (!answer.ok) throw new Error(`corrections cannot be read: ${(await answer.text()).trim()}`);
    return new Corrections(await answer.json(), tell);
  }

  get keys() { return Object.keys(this.photos).sort(); }

  of(key) { return this.photos[key]; }

  /** Where the corrections are kept, in words. */
  get message() {
    const count = this.unsaved.size, photos = `${count} ${count === 1 ? 'photo' : 'photos'}`;
    if (!this.token) return count ? `${photos} not saved: this page has no server. Download the corrections before you leave` : '';
    if (this.problem) return `${photos} not saved: ${this.problem}`;
    if (count) return 'saving ...';
    return this.keys.length ? `saved in ${this.folder}: name it as labels.corrections and run again` : '';
  }

  /** All boxes of a photo from now on; what was before can be had back. */
  put(key, boxes) { this.#become({ ...this.photos, [key]: boxes }); }

  /** The photo is as the run labelled it. */
  drop(key) {
    const { [key]: _, ...others } = this.photos;
    this.#become(others);
  }

  /** Every photo is as the run labelled it. */
  dropAll() { this.#become({}); }

  undo() {
    if (!this.past.length) return false;
    this.#take(this.past.pop());
    return true;
  }

  #become(photos) {
    this.past.push(this.photos);
    if (this.past.length > 200) this.past.shift();
    this.#take(photos);
  }

  #take(photos) {
    const before = this.photos;
    this.photos = photos;
    for (const key of new Set([...Object.keys(before), ...Object.keys(photos)])) if (before[key] !== photos[key]) this.unsaved.add(key);
    this.save();
  }

  /** Send every photo that the server does not have as it is now; photos that it refuses stay unsaved. */
  save() {
    if (this.token) this.sending ??= this.#sendAll().finally(() => { this.sending = null; this.tell(); });
    this.tell();
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
    try { answer = await fetch(`${URL_OF}/${key}`, request); } catch { throw new Error('the server does not answer. Download the corrections'); }
    if (answer.status === 403) throw new Error('the server was started anew. Download the corrections, then reload the page');
    if (!answer.ok) throw new Error((await answer.text()).trim());
  }
}

/** The part of a box that is inside the photo; null where none is. */
export function clipped(box, { width, height }) {
  const part = { ...box, x0: Math.max(0, box.x0), y0: Math.max(0, box.y0), x1: Math.min(width, box.x1), y1: Math.min(height, box.y1) };
  return Math.min(part.x1 - part.x0, part.y1 - part.y0) >= LEAST_PX ? part : null;
}

/** A COCO file that `labels.corrections` reads: every photo with all its boxes. */
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
 * The box after a drag by (dx, dy) pixels of what was taken: some of the letters w e n s, or all of it. It stays inside
 * the photo and at least a pixel wide and high.
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

/** What of a box lies at a point: letters of its edges within reach, '' in the middle, null outside. */
export function grip(box, x, y, reach) {
  const near = (a, b) => Math.abs(a - b) <= reach;
  if (x < box.x0 - reach || x > box.x1 + reach || y < box.y0 - reach || y > box.y1 + reach) return null;
  const across = near(x, box.x0) ? 'w' : near(x, box.x1) ? 'e' : '';
  return (near(y, box.y0) ? 'n' : near(y, box.y1) ? 's' : '') + across;
}
