// Grey values of images: exposure, difference, sum over lamps.

export const GAMMA = 2.2;
const WHITE_SHARE = 0.997; // share of pixels below white
const FLOOR = 4 / 4079; // share of the sensor's range, suppresses differences within the noise
const MAX_STOPS = 2; // difference at the saturated colours

const linear = Float32Array.from({ length: 256 }, (_, code) => (code / 255) ** GAMMA);
const stops = Float32Array.from(linear, (value) => Math.log2(value + FLOOR));

const loaded = new Map();
const CACHE_SIZE = 24;

/** Load an image: width, height, and codes (share of the sensor's range with gamma 2.2). */
export function read(url) {
  if (loaded.has(url)) return loaded.get(url);
  const answer = decode(url);
  answer.catch(() => loaded.delete(url));
  loaded.set(url, answer);
  if (loaded.size > CACHE_SIZE) loaded.delete(loaded.keys().next().value);
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

/** Mean code of a loaded small image, 0 to 1. */
function meanBrightness(picture) {
  const pen = new OffscreenCanvas(16, 10).getContext('2d');
  pen.drawImage(picture, 0, 0, 16, 10);
  const pixels = pen.getImageData(0, 0, 16, 10).data;
  let sum = 0;
  for (let index = 0; index < pixels.length; index += 4) sum += pixels[index];
  return sum / (pixels.length / 4) / 255;
}

const gains = new Map();

/** Brightness factor for a dark image, computed from the small copy; 1 without a small copy. */
export function gainOf(small) {
  if (!gains.has(small)) {
    const picture = new Image();
    picture.src = small;
    gains.set(small, picture.decode().then(() => brightening(picture)).catch(() => 1));
  }
  return gains.get(small);
}

/** Brightness factor (CSS) that raises the mean of a loaded image to 0.38. */
export const brightening = (picture) => Number(Math.min(8, Math.max(1, 0.38 / Math.max(meanBrightness(picture), 0.01))).toFixed(2));

/** White level of an image in automatic mode, share of the sensor's range. */
export function whiteOf({ codes }) {
  const count = new Uint32Array(256);
  for (const code of codes) count[code] += 1;
  let left = codes.length * (1 - WHITE_SHARE), code = 255;
  while (code > 1 && (left -= count[code]) > 0) code -= 1;
  return Math.max(linear[code], 40 / 4079);
}

/** An image multiplied by a gain. */
export function exposed({ width, height, codes }, gain) {
  const shade = Uint8ClampedArray.from(linear, (value) => Math.round(255 * Math.min(1, value * gain) ** (1 / GAMMA)));
  const data = new ImageData(width, height), pixels = new Uint32Array(data.data.buffer);
  const grey = Uint32Array.from(shade, (value) => 0xff000000 | (value << 16) | (value << 8) | value);
  for (let index = 0; index < codes.length; index += 1) pixels[index] = grey[codes[index]];
  return data;
}

/** Colour-coded log ratio of `second` to `first`: blue where darker, black where equal, orange where brighter. */
export function difference(first, second) {
  if (first.codes.length !== second.codes.length) throw new Error('the images have different sizes');
  const data = new ImageData(first.width, first.height), pixels = new Uint32Array(data.data.buffer);
  const colours = Uint32Array.from({ length: 513 }, (_, index) => diverging((index - 256) / 256));
  for (let index = 0; index < pixels.length; index += 1) {
    const off = (stops[second.codes[index]] - stops[first.codes[index]]) / MAX_STOPS;
    pixels[index] = colours[256 + Math.round(256 * Math.max(-1, Math.min(1, off)))];
  }
  return data;
}

/** Colour of a value from -1 (blue) over 0 (black) to 1 (orange), suitable for colour-blind readers, as a pixel. */
export function diverging(value) {
  const [r, g, b] = value < 0 ? [70, 190, 255] : [255, 140, 0];
  const share = Math.abs(value) ** 0.7;
  return (0xff000000 | (Math.round(b * share) << 16) | (Math.round(g * share) << 8) | Math.round(r * share)) >>> 0;
}

/** Weighted sum of images of single lamps, multiplied by a gain. */
export function summed(pictures, weights, gain) {
  const { width, height } = pictures[0];
  const sum = new Float32Array(width * height);
  pictures.forEach(({ codes }, number) => {
    const weighted = linear.map((value) => value * weights[number]);
    for (let index = 0; index < sum.length; index += 1) sum[index] += weighted[codes[index]];
  });
  const data = new ImageData(width, height), pixels = new Uint32Array(data.data.buffer);
  const shade = Uint32Array.from({ length: 4096 }, (_, value) => {
    const grey = Math.round(255 * (value / 4095) ** (1 / GAMMA));
    return 0xff000000 | (grey << 16) | (grey << 8) | grey;
  });
  for (let index = 0; index < sum.length; index += 1) pixels[index] = shade[Math.min(4095, Math.round(4095 * sum[index] * gain))];
  return data;
}
