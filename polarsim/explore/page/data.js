// Files of the run: tables and JSON, each loaded once.

const answers = new Map();

function once(url, read) {
  if (!answers.has(url)) {
    const answer = fetch(url).then((response) => {
      if (!response.ok) throw new Error(`${url}: ${response.status}`);
      return read(response);
    });
    answer.catch(() => answers.delete(url));
    answers.set(url, answer);
  }
  return answers.get(url);
}

/** A JSON file. */
export const json = (url) => once(url, (response) => response.json());

/**
 * A table: number of `rows`, and `columns` by name as typed arrays. A column of texts contains codes, and
 * `values[name]` lists the texts by code.
 */
export const table = (url) => once(url, async (response) => columnsOf(await response.arrayBuffer()));

export function columnsOf(content) {
  const arrow = globalThis.fl.tableFromIPC(content);
  const result = { rows: arrow.numRows, columns: {}, values: {} };
  for (const { name, type } of arrow.schema.fields) {
    const column = arrow.getChild(name);
    const batch = column.data[0];
    if (batch && batch.dictionary) {
      result.columns[name] = batch.values;
      result.values[name] = [...batch.dictionary];
    } else {
      if (type.indices) result.values[name] = []; // column of texts without rows
      result.columns[name] = arrow.numRows ? column.toArray() : new Float32Array(0);
    }
  }
  return result;
}

/** One row of a table as an object. */
export function row(of, number) {
  const result = {};
  for (const [name, column] of Object.entries(of.columns)) {
    const value = column[number];
    result[name] = of.values[name] ? of.values[name][value] : value;
  }
  return result;
}

/** The rows of each key of a table that is sorted by key: Map of key -> [first, end). */
export function spans(of) {
  if (of.spans) return of.spans;
  of.spans = new Map();
  const codes = of.columns.key;
  for (let start = 0; start < of.rows;) {
    let end = start + 1;
    while (end < of.rows && codes[end] === codes[start]) end += 1;
    of.spans.set(of.values.key[codes[start]], [start, end]);
    start = end;
  }
  return of.spans;
}

/** The rows of one key. */
export function rowsOf(of, key) {
  const [start, end] = spans(of).get(key) ?? [0, 0];
  return Array.from({ length: end - start }, (_, index) => row(of, start + index));
}

/** The terrain of a text: a number or a name. */
export const terrainOf = (text) => (/^\d+$/.test(text) ? Number(text) : text);

/** Terrain and rock of a text like `3.154`. */
export function rockOf(text) {
  const [terrain, rock] = text.split('.');
  return [terrainOf(terrain), Number(rock)];
}

/** The parts of a photo key. */
export function parts(key) {
  const [terrain, position, light, azimuth, camera, exposure] = key.split('_');
  return { terrain: terrainOf(terrain), position, light, azimuth, camera, exposure: Number(exposure) };
}

export function keyOf({ terrain, position, light, azimuth, camera, exposure }) {
  const named = typeof terrain === 'number' ? String(terrain).padStart(2, '0') : terrain;
  return `${named}_${position}_${light}_${azimuth}_${camera}_${String(exposure).padStart(4, '0')}`;
}

export const bracketOf = (key) => key.slice(0, key.lastIndexOf('_'));

/** The run: available data and the table of images. Loaded by `open`. */
export const run = { about: null, pictures: null, rows: new Map(), brackets: new Map() };

export async function open() {
  [run.about, run.pictures] = await Promise.all([json('data/run.json'), table('data/pictures.arrow')]);
  const { key, domain } = run.pictures.columns;
  const { key: keys, domain: domains } = run.pictures.values;
  for (let index = 0; index < run.pictures.rows; index += 1) {
    const name = keys[key[index]];
    run.rows.set(`${domains[domain[index]]}/${name}`, index);
    const bracket = bracketOf(name);
    if (!run.brackets.has(bracket)) run.brackets.set(bracket, new Set());
    run.brackets.get(bracket).add(parts(name).exposure);
  }
  for (const [name, times] of run.brackets) run.brackets.set(name, [...times].sort((a, b) => a - b));
}

export const keyAt = (index) => run.pictures.values.key[run.pictures.columns.key[index]];
export const domainAt = (index) => run.pictures.values.domain[run.pictures.columns.domain[index]];
export const has = (domain, key) => run.rows.has(`${domain}/${key}`);
/** Whether the run has a photo or a twin of a key. */
export const known = (key) => run.about.domains.some((domain) => has(domain, key));
export const pictureUrl = (domain, key) => `data/pictures/${domain}/${key}.jpg`;
export const smallUrl = (domain, key) => `data/small/${domain}/${key}.jpg`;
export const labelsOf = (terrain, ofTwins) => table(`data/labels/${ofTwins ? 'twins' : 'photo'}/${terrain}.arrow`);

/** The exposure of a bracket nearest to the wanted exposure, in stops. */
export function nearestExposure(bracket, wanted) {
  const off = (exposure) => Math.abs(Math.log2(exposure / wanted));
  return (run.brackets.get(bracket) ?? []).reduce((best, one) => (off(one) < off(best) ? one : best), Infinity);
}
