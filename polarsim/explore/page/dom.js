// Functions that create elements, and the controls common to all views.

const SVG = 'http://www.w3.org/2000/svg';

/** Create an HTML element from attributes (`on...`: listeners, `text`: text content) and children. */
export function h(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** Create an SVG element. */
export function s(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name === 'text') element.textContent = value;
    else if (typeof value === 'boolean') { if (value) element.setAttribute(name, ''); }
    else if (value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** A labelled control. */
export const labelled = (text, control) => h('label', {}, text, control);

/** A labelled select element; options are texts or [value, text]. */
export function chooser(text, options, value, change) {
  const list = h('select', { 'aria-label': text, onchange: () => change(list.value) }, options.map((option) => {
    const [name, shown] = Array.isArray(option) ? option : [option, option];
    return h('option', { value: name, text: shown, selected: String(name) === String(value) });
  }));
  return labelled(text, list);
}

/** A toggle button. */
export function toggle(text, on, change, title = '') {
  return h('button', { type: 'button', 'aria-pressed': String(on), title, onclick: () => change(!on), text });
}

/** A labelled slider; `shown` formats the value. */
export function slider(text, { min, max, step, value, shown = String, disabled = false }, change) {
  const output = h('output', { text: shown(value) });
  const input = h('input', {
    type: 'range', min, max, step, value, disabled, 'aria-label': text,
    oninput: () => { output.textContent = shown(Number(input.value)); change(Number(input.value)); },
  });
  return labelled(text, h('span', { class: 'bar', style: 'padding:0' }, input, output));
}

/** Delay a call; further calls within the delay replace the first. */
export function soon(call, milliseconds = 30) {
  let timer = 0;
  return (...values) => { clearTimeout(timer); timer = setTimeout(() => call(...values), milliseconds); };
}

/** Replace the children; restore the focus, and wait for the end of a drag of a slider. */
export function renew(container, make) {
  const active = container.contains(document.activeElement) ? document.activeElement : null;
  if (active && active.type === 'range' && active.matches(':active')) {
    active.addEventListener('change', () => renew(container, make), { once: true });
    return;
  }
  const controls = () => [...container.querySelectorAll('button, select, input')];
  const number = active ? controls().indexOf(active) : -1;
  container.replaceChildren(...make());
  if (number >= 0) controls()[number]?.focus();
}
