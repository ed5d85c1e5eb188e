// Start of the page: loads the run, builds views on first use, handles keys and address.

import { open, run } from './data.js';
import { h } from './dom.js';
import { followAddress, onChange, set, shows, state, switchMark } from './state.js';
import * as compare from './compare.js';
import * as correct from './correct.js';
import * as detectors from './detectors.js';
import * as grid from './grid.js';
import * as rock from './rock.js';
import * as rover from './rover.js';
import * as terrain from './terrain.js';

const VIEWS = [
  ['photos', 'Photos', grid], ['compare', 'Compare', compare], ['terrain', '3-D', terrain],
  ['detectors', 'Detectors', detectors], ['rover', 'Rover', rover], ['correct', 'Correct', correct],
];
const OF_ONE_PICTURE = new Set(['compare', 'correct']); // default: photo with the most similar twin
const built = new Set();

function show() {
  const chosen = VIEWS.find(([name]) => name === state.view) ?? VIEWS[0];
  for (const [name, , module] of VIEWS) {
    const section = document.getElementById(name);
    section.hidden = name !== chosen[0];
    document.getElementById(`tab-${name}`).toggleAttribute('aria-current', false);
    if (section.hidden || built.has(name)) continue;
    built.add(name);
    module.build(section);
  }
  document.getElementById(`tab-${chosen[0]}`).setAttribute('aria-current', 'page');
  return chosen;
}

async function refresh(changed) {
  const [name, , module] = show();
  if (OF_ONE_PICTURE.has(name) && !state.key && grid.shown.length) return set(grid.first()); // calls this again
  if (changed.has('rock') || changed.has('all')) await rock.refresh();
  if (name === 'compare' && changed.size === 1 && changed.has('split')) compare.drawSplit();
  else await module.refresh(changed);
}

function key(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const { tagName, type } = event.target;
  if (tagName === 'SELECT' || (tagName === 'INPUT' && type !== 'checkbox') || event.defaultPrevented) return;
  const number = Number(event.key);
  if (number >= 1 && number <= VIEWS.length) set({ view: VIEWS[number - 1][0] });
  else if ('bmilp'.includes(event.key)) switchMark(event.key);
  else if (event.key === '?') document.getElementById('help').showModal();
  else if (event.key === 'Escape') set({ rock: '' });
  else if (event.key === 'n') compare.nextRock();
  else if (event.key === '+' || event.key === '=') set({ ev: Math.min(6, state.ev + 0.5) });
  else if (event.key === '-') set({ ev: Math.max(-6, state.ev - 0.5) });
  else if (state.view === 'compare' && { ArrowLeft: 1, ArrowRight: 1 }[event.key]) grid.step(event.key === 'ArrowLeft' ? -1 : 1);
  else if (state.view === 'compare' && { ArrowUp: 1, ArrowDown: 1 }[event.key]) compare.stepExposure(event.key === 'ArrowUp' ? 1 : -1);
  else if (state.view === 'rover' && { ArrowLeft: 1, ArrowRight: 1 }[event.key]) rover.step(event.key === 'ArrowLeft' ? -1 : 1);
  else return;
  event.preventDefault();
}

async function start() {
  const status = document.getElementById('status');
  followAddress();
  try {
    await open();
    document.getElementById('run').textContent = run.about.run;
    document.title = `polarsim ${run.about.run}`;
    document.getElementById('tabs').append(...VIEWS.map(([name, text], index) => h('button', {
      type: 'button', id: `tab-${name}`, title: `key ${index + 1}`, text, onclick: () => set({ view: name }),
    })), ' ');
    rock.build(document.getElementById('rock'));
    grid.build(document.getElementById('photos'));
    built.add('photos');
    document.getElementById('help-open').addEventListener('click', () => document.getElementById('help').showModal());
    document.addEventListener('keydown', key);
    await grid.refresh(); // arrow keys of other views use the order of the grid
    const update = async (changed) => {
      try {
        await refresh(changed);
        status.textContent = `terrains ${run.about.terrains.join(', ')}: ${run.pictures.rows} images`;
      } catch (error) {
        status.textContent = `not available: ${error.message}`;
        console.warn(error);
      }
    };
    onChange(update);
    await update(new Set(['all']));
    document.body.dataset.ready = 'yes';
  } catch (error) {
    status.textContent = `the run cannot be loaded: ${error.message}`;
    throw error;
  }
}

addEventListener('DOMContentLoaded', start);
