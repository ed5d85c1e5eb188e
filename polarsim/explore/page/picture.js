// Grey values of pictures, and pictures made of them: exposed anew, compared, summed over lamps.

export const GAMMA = 2.2;
const WHITE_SHARE = 0.997; // of the pixels; brighter ones are shown white
const FLOOR = 4 / 4079; // of the sensor's range: differences of less than the noise are none
const MOST_STOPS = 2; // of a difference at the ends of its colours

const linear = Float32Array.from({ length: 256 }, (_, code) => (code / 255) ** GAMMA);
const stops = Float32Array.from(linear, (value) => Math.log2(value + FLOOR));

const loaded = new Map();
const MOST_KEPT = 24;

/** A picture's codes (gamma 2.2 of its share of the sensor's range), with width and height. */
export function read(url) {
  if (loaded.has(url)) return loaded.get(url);
  const answer = decode(url);
  answer.catch(() => loaded.delete(url));
  loaded.set(url, answer);
  if (loaded.size > MOST_KEPT) loaded.delete(loaded.keys().next().value);
  return answer;
}

async function decode(url) {
  const picture = new Image();
  picture.src = url;
  await picture.decode();
  const { naturalWidth: width, naturalHeight: height } = picture;
  const pen = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
  pen.drawImage(picture, 0, 0);
  const pixels = pen.getImageData(0, 0, width, height).data;
  const codes = new Uint8Array(width * height);
  for (let index = 0; index < codes.length; index += 1) codes[index] = pixels[4 * index];
  return { width, height, codes };
}

/** Mean code of a small picture that is loaded, 0 to 1. */
function meanBrightness(picture) {
  const pen = new OffscreenCanvas(16, 10).getContext('2d');
  pen.drawImage(picture, 0, 0, 16, 10);
  const pixels = pen.getImageData(0, 0, 16, 10).data;
  let sum = 0;
  for (let index = 0; index < pixels.length; index += 4) sum += pixels[index];
  return sum / (pixels.length / 4) / 255;
}

const gains = new Map();

/** By how much a style must brighten a picture that its small copy shows to be dark; 1 where there is none. */
export function gainOf(small) {
  if (!gains.has(small)) {
    const picture = new Image();
    picture.src = small;
    gains.set(small, picture.decode().then(() => brightening(picture)).catch(() => 1));
  }
  return gains.get(small);
}

/** Gain of a style that makes the mean of a loaded picture one that people can look at; white stays white. */
export const brightening = (picture) => Number(Math.min(8, Math.max(1, 0.38 / Math.max(meanBrightness(picture), 0.01))).toFixed(2));

/** What is shown white without a slider's help: share of the sensor's range. */
export function whiteOf({ codes }) {
  const count = new Uint32Array(256);
  for (const code of codes) count[code] += 1;
  let left = codes.length * (1 - WHITE_SHARE), code = 255;
  while (code > 1 && (left -= count[code]) > 0) code -= 1;
  return Math.max(linear[code], 40 / 4079);
}

/** A picture at a gain. */
export function exposed({ width, height, codes }, gain) {
  const shade = Uint8ClampedArray.from(linear, (value) => Math.round(255 * Math.min(1, value * gain) ** (1 / GAMMA)));
  const data = new ImageData(width, height), pixels = new Uint32Array(data.data.buffer);
  const grey = Uint32Array.from(shade, (value) => 0xff000000 | (value << 16) | (value << 8) | value);
  for (let index = 0; index < codes.length; index += 1) pixels[index] = grey[codes[index]];
  return data;
}

/** How much brighter `second` is than `first`: blue where darker, black where even, orange where brighter. */
export function difference(first, second) {
  if (first.codes.length !== second.codes.length) throw new Error('pictures of two sizes have no difference');
  const data = new ImageData(first.width, first.height), pixels = new Uint32Array(data.data.buffer);
  const colours = Uint32Array.from({ length: 513 }, (_, index) => diverging((index - 256) / 256));
  for (let index = 0; index < pixels.length; index += 1) {
    const off = (stops[second.codes[index]] - stops[first.codes[index]]) / MOST_STOPS;
    pixels[index] = colours[256 + Math.round(256 * Math.max(-1, Math.min(1, off)))];
  }
  return data;
}

/** Blue over black to orange, apart for colour-blind eyes too: value -1 to 1, as the canvas keeps a pixel. */
export function diverging(value) {
  const [r, g, b] = value < 0 ? [70, 190, 255] : [255, 140, 0];
  const share = Math.abs(value) ** 0.7;
  return (0xff000000 | (Math.round(b * share) << 16) | (Math.round(g * share) << 8) | Math.round(r * share)) >>> 0;
}

/** The sum of pictures under one lamp each, with weights, at a gain. */
export function summed(pictures, weights, gain) {
  const { width, height } = pictures[0];
  const sum = new Float32Array(width * height);
  pictures.forEach(({ codes }, number) => {
    const own = linear.map((value) => value * weights[number]);
    for (let index = 0; index < sum.length; index += 1) sum[index] += own[codes[index]];
  });
  const data = new ImageData(width, height), pixels = new Uint32Array(data.data.buffer);
  const shade = Uint32Array.from({ length: 4096 }, (_, value) => {
    const grey = Math.round(255 * (value / 4095) ** (1 / GAMMA));
    return 0xff000000 | (grey << 16) | (grey << 8) | grey;
  });
  for (let index = 0; index < sum.length; index += 1) pixels[index] = shade[Math.min(4095, Math.round(4095 * sum[index] * gain))];
  return data;
}
