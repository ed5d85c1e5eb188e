// Boxes that a person put right, photo by photo: kept in the browser, undone, downloaded as COCO.

const KINDS = ['rock', 'shadow'];

export class Corrections {
  constructor(name, store = globalThis.localStorage) {
    this.item = `polarsim corrections of ${name}`;
    this.store = store;
    this.past = [];
    try { this.photos = JSON.parse(store.getItem(this.item) ?? '{}'); } catch { this.photos = {}; }
  }

  get keys() { return Object.keys(this.photos).sort(); }

  of(key) { return this.photos[key]; }

  /** All boxes of a photo from now on; what was before can be had back. */
  put(key, boxes) {
    this.past.push(JSON.stringify(this.photos));
    if (this.past.length > 200) this.past.shift();
    this.photos = { ...this.photos, [key]: boxes };
    this.#keep();
  }

  /** The photo is as the run labelled it. */
  drop(key) {
    this.past.push(JSON.stringify(this.photos));
    const { [key]: _, ...others } = this.photos;
    this.photos = others;
    this.#keep();
  }

  undo() {
    if (!this.past.length) return false;
    this.photos = JSON.parse(this.past.pop());
    this.#keep();
    return true;
  }

  #keep() { this.store.setItem(this.item, JSON.stringify(this.photos)); }
}

/** A COCO file that `labels.corrections` reads: every photo with all its boxes. */
export function coco(photos, { width, height }) {
  const keys = Object.keys(photos).sort();
  const annotations = keys.flatMap((key, image) => photos[key].filter((one) => inside(one, width, height)).map((one) => ({
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

const inside = (one, width, height) => one.x1 > one.x0 && one.y1 > one.y0 && one.x0 < width && one.y0 < height && one.x1 > 0 && one.y1 > 0;

/** The box after a drag by (dx, dy) pixels of what was taken: some of the letters w e n s, or all of it. */
export function dragged(box, grip, dx, dy) {
  const moved = { ...box };
  const all = grip === '';
  if (all || grip.includes('w')) moved.x0 += dx;
  if (all || grip.includes('e')) moved.x1 += dx;
  if (all || grip.includes('n')) moved.y0 += dy;
  if (all || grip.includes('s')) moved.y1 += dy;
  if (moved.x1 < moved.x0) [moved.x0, moved.x1] = [moved.x1, moved.x0];
  if (moved.y1 < moved.y0) [moved.y0, moved.y1] = [moved.y1, moved.y0];
  return moved;
}

/** What of a box lies at a point: letters of its edges within reach, '' in the middle, null outside. */
export function grip(box, x, y, reach) {
  const near = (a, b) => Math.abs(a - b) <= reach;
  if (x < box.x0 - reach || x > box.x1 + reach || y < box.y0 - reach || y > box.y1 + reach) return null;
  const across = near(x, box.x0) ? 'w' : near(x, box.x1) ? 'e' : '';
  return (near(y, box.y0) ? 'n' : near(y, box.y1) ? 's' : '') + across;
}
