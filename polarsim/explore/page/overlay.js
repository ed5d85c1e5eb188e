// Overlay of an image: boxes, masks, rock ids, lines from shadows to rocks, predictions.

import { bracketOf, json, labelsOf, parts, rowsOf, run, spans, table } from './data.js';
import { s } from './dom.js';
import { gainOf } from './picture.js';
import { set, shows, state } from './state.js';

export const DOUBTFUL = 0.5; // labels with lower confidence are dashed

/** The labels of a photo or of its twins. */
export async function labels(key, ofTwins) {
  return rowsOf(await labelsOf(parts(key).terrain, ofTwins), key);
}

/** Predictions in a photo above the confidence threshold; null if the detector was not tested on the photo. */
export async function predictions(key, name = state.detector) {
  if (!name) return null;
  const all = await table(`data/predictions/${name}.arrow`);
  if (!spans(all).has(key)) return null;
  return rowsOf(all, key).filter((one) => one.confidence >= state.confidence);
}

/** Draw the enabled marks into an SVG in pixels of the photo. */
export async function draw(svg, key) {
  const ofTwins = state.labels !== 'photo';
  const [own, rings, seen] = await Promise.all([
    labels(key, ofTwins),
    shows('m') ? json(`data/outlines/${ofTwins ? 'twins' : 'photo'}/${bracketOf(key)}.json`).catch(() => []) : [],
    shows('p') ? predictions(key) : null,
  ]);
  const kinds = [...own].sort((a, b) => b.kind.localeCompare(a.kind)); // rocks above shadows
  svg.replaceChildren(
    ...rings.map(({ kind, ring }) => s('polygon', { class: `mask ${kind}`, points: ring.join(' ') })),
    ...(shows('l') ? links(own) : []),
    ...(shows('b') ? kinds.map((one) => box(one, one.confidence < DOUBTFUL ? 'doubtful' : '')) : []),
    ...(seen ?? []).map((one) => box(one, `seen ${one.false_positive ? 'false' : ''}`)),
    ...(shows('i') ? kinds.map(tag).filter(Boolean) : []),
    ...(seen ? seen.map((one) => s('text', { x: one.x0, y: one.y1 + 20 * photoScale(), text: one.confidence.toFixed(2) })) : []),
  );
  return { own, seen };
}

/** Height of the photos relative to POLAR's, for texts in pixels of the photo: the window limits the height. */
export const photoScale = () => run.about.height / 1216;

const centre = (one) => [(one.x0 + one.x1) / 2, (one.y0 + one.y1) / 2];

function box(one, more) {
  const { terrain } = parts(state.key);
  const chosen = one.rock >= 0 && state.rock === `${terrain}.${one.rock}` && !more.startsWith('seen');
  const description = `${one.kind} ${one.rock < 0 ? 'without rock id' : one.rock}, confidence ${one.confidence.toFixed(2)}${one.source ? `, ${one.source}` : ''}`;
  return s('rect', {
    class: `box ${one.kind} ${more} ${chosen ? 'chosen' : ''}`, x: one.x0, y: one.y0, width: one.x1 - one.x0, height: one.y1 - one.y0,
    'data-rock': one.rock, onclick: () => one.rock >= 0 && set({ rock: `${terrain}.${one.rock}` }),
  }, s('title', { text: description }));
}

function tag(one) {
  if (one.rock < 0) return null;
  const sure = one.confidence < 0.995 ? ` ${one.confidence.toFixed(2).slice(1)}` : '';
  return s('text', { class: one.kind, x: one.x0, y: one.kind === 'rock' ? one.y0 - 6 * photoScale() : one.y1 + 20 * photoScale(), text: `${one.rock}${sure}` });
}

/** Lines from every shadow to the nearest label of the same rock. */
function links(own) {
  const rocks = own.filter((one) => one.kind === 'rock' && one.rock >= 0);
  return own.filter((one) => one.kind === 'shadow').flatMap((shadow) => {
    const [x, y] = centre(shadow);
    const ends = rocks.filter((rock) => rock.rock === shadow.rock).map(centre);
    if (!ends.length) return [];
    const [u, v] = ends.reduce((best, end) => (Math.hypot(end[0] - x, end[1] - y) < Math.hypot(best[0] - x, best[1] - y) ? end : best));
    return [s('line', { class: 'link', x1: x, y1: y, x2: u, y2: v })];
  });
}

/** Crop of an image around a box, as SVG. */
export function crop(url, one, more = [], margin = 0.6) {
  const { width, height } = run.about;
  const [x, y] = centre(one);
  const side = Math.max(48, (1 + 2 * margin) * Math.max(one.x1 - one.x0, 1.4 * (one.y1 - one.y0)));
  const picture = s('image', { href: url, width, height, preserveAspectRatio: 'none' });
  gainOf(url.replace('/pictures/', '/small/')).then((gain) => { picture.style.filter = `brightness(${gain})`; });
  return s('svg', { viewBox: `${x - side / 2} ${y - side / 2.8} ${side} ${side / 1.4}`, preserveAspectRatio: 'xMidYMid slice', 'aria-hidden': 'true' }, picture, more);
}

/** The outline of a box for a crop. */
export const outline = (one, kind) => s('rect', { class: `box ${kind}`, x: one.x0, y: one.y0, width: one.x1 - one.x0, height: one.y1 - one.y0 });
