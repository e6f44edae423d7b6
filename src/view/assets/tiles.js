// Tiles: cycles of a binned machine's tiles: as a map over the picture, and as a timeline of units, tile by tile.
'use strict';

// Contents of tiles.csv, checked against the report of the frame; null if it is absent.
const tilesOf = (text, cycles) => {
  if (!text) return null;
  const [heads, ...lines] = text.trim().split('\n').map(line => line.split(','));
  const at = name => { const place = heads.indexOf(name); if (place < 0) throw new Error(`tiles.csv has no column ${name}`); return place; };
  const places = ['column', 'row', 'side_px', 'from', 'entries', 'done', 'cycles'].map(at);
  const own = heads.filter(name => name.endsWith('_until')).map(name => name.slice(0, -6)), base = name => name.replace(/\.\d+$/, '');
  const of = own.map(name => ['until', 'busy', 'starved', 'blocked', 'memory'].map(what => at(`${name}_${what}`)));
  // Each engine has its own units; a folder without engine numbers has one engine.
  const engine = heads.indexOf('engine'), engines = engine < 0 ? 1 : 1 + Math.max(0, ...lines.map(line => Number(line[engine])));
  const names = Array.from({ length: engines }, (_, nth) => own.map(name => engines > 1 ? `${name} of engine ${nth}` : name)).flat();
  const last = names.map(() => null);
  const tiles = lines.map(line => {
    const cells = line.map(Number);
    if (cells.length !== heads.length || !cells.every(Number.isSafeInteger)) throw new Error('tiles.csv has a line with a value that is not a number');
    const [column, row, side, from, entries, done, ownCycles] = places.map(place => cells[place]);
    // A unit has no share in another engine's tile: the share ends where it begins.
    const first = (engine < 0 ? 0 : cells[engine]) * own.length;
    of.forEach((places, nth) => { last[first + nth] = places.map(place => cells[place]); });
    const units = last.map((cells, nth) => nth >= first && nth < first + own.length ? cells : [cells?.[0] ?? from, 0, 0, 0, 0]);
    return { column, row, side, from, entries, done, cycles: ownCycles, units };
  });
  if (!tiles.length) return null;
  const busy = name => cycles.units.filter(unit => base(unit.name) === name).reduce((sum, unit) => sum + unit.busy, 0);
  // Only for units of the second pass; shade may have worked in the first.
  new Set(own.map(base)).forEach(name => {
    const places = names.map((_, nth) => nth).filter(nth => base(own[nth % own.length]) === name);
    const sum = tiles.reduce((sum, tile) => sum + places.reduce((sum, nth) => sum + tile.units[nth][1], 0), 0);
    if (name !== 'shade' && sum !== busy(name)) throw new Error('tiles.csv belongs to another frame than the report');
  });
  const byPlace = new Map(tiles.map(tile => [tile.column + ',' + tile.row, tile]));
  return { names, tiles, side: tiles[0].side, from: tiles[0].from, at: (x, y) => byPlace.get(Math.floor(x / tiles[0].side) + ',' + Math.floor(y / tiles[0].side)) };
};
const foldersTiles = (() => {
  let asked = null;
  return folder => asked ??= (folder.tiles ? source.text('tiles.csv') : Promise.resolve(null)).then(text => tilesOf(text, folder.run?.report.cycles ?? folder.cycles));
})();
// The tile of a pixel, at which the timeline begins.
let lookedAtTile = null;

// One band per unit: each column shows the unit's states in those cycles.
const tilesTimeline = ({ names, tiles, from }) => {
  const STATES = ['busy', 'starved', 'blocked', 'memory'], ROW = 34, LEFT = 90, FOOT = 40, HEAD = 22;
  const inks = () => ({ busy: ink('c0'), starved: ink('line'), blocked: ink('c1'), memory: ink('c4') });
  const end = Math.max(...tiles.map(tile => Math.max(tile.done, ...tile.units.map(([until]) => until))));
  let [first, last] = [from, end], chosen = null;
  const canvas = h('canvas', { tabindex: '0', role: 'img', 'aria-label': 'units over the cycles of tiles' });
  canvas.style.cssText = 'width: 100%; touch-action: pan-y; cursor: crosshair;';
  canvas.style.height = HEAD + ROW * names.length + FOOT + 'px';
  const readout = h('p', { class: 'faint', id: 'tile-says', 'aria-live': 'polite' });

  // The first tile whose share of a unit ends after a cycle.
  const tileAt = (nth, cycle) => {
    let [low, high] = [0, tiles.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (tiles[middle].units[nth][0] > cycle) high = middle; else low = middle + 1;
    }
    return low;
  };
  const start = (nth, tile) => tile ? tiles[tile - 1].units[nth][0] : from;
  // Its states between two cycles, as parts; a share is assumed to be uniform.
  const parts = (nth, low, high) => {
    const sums = [0, 0, 0, 0];
    let left = high - low;
    for (let tile = tileAt(nth, low); tile < tiles.length && start(nth, tile) < high; tile += 1) {
      const [until, ...states] = tiles[tile].units[nth], begins = start(nth, tile);
      if (until <= begins) continue;
      const overlap = Math.min(until, high) - Math.max(begins, low);
      if (overlap <= 0) continue;
      states.forEach((cycles, state) => { sums[state] += cycles * overlap / (until - begins); });
      left -= overlap;
    }
    // After its last tile the unit is idle.
    sums[1] += Math.max(0, left);
    return sums.map(sum => sum / (high - low));
  };
  const wide = () => canvas.clientWidth - LEFT - 8;
  const X = cycle => LEFT + wide() * (cycle - first) / (last - first);
  const cycleAt = x => first + (last - first) * Math.max(0, Math.min(1, (x - LEFT) / wide()));

  let wanted = 0;
  const draw = () => { cancelAnimationFrame(wanted); wanted = requestAnimationFrame(paint); };
  const paint = () => {
    const ratio = devicePixelRatio || 1, [W, H] = [canvas.clientWidth, canvas.clientHeight];
    if (!W) return;
    [canvas.width, canvas.height] = [Math.round(W * ratio), Math.round(H * ratio)];
    const context = canvas.getContext('2d'), shades = inks();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, W, H);
    context.font = '12px system-ui, sans-serif';
    names.forEach((name, nth) => {
      const top = HEAD + nth * ROW;
      context.fillStyle = ink('ink');
      context.textAlign = 'right';
      context.fillText(name, LEFT - 8, top + ROW / 2 + 1);
      for (let column = 0; column < wide(); column += 1) {
        const here = parts(nth, first + (last - first) * column / wide(), first + (last - first) * (column + 1) / wide());
        let y = top + ROW - 6;
        // Busy at the bottom, then the stalls, starved at the top.
        [0, 2, 3, 1].forEach(state => {
          const high = here[state] * (ROW - 8);
          context.fillStyle = shades[STATES[state]];
          context.fillRect(LEFT + column, y - high, 1, high);
          y -= high;
        });
      }
      context.fillStyle = ink('ink');
      context.textAlign = 'center';
      // Ends of its tiles, if they can be distinguished.
      const begins = tileAt(nth, first), ends = wide() < 12 * (tileAt(nth, last) - begins) ? begins : tiles.length;
      for (let tile = begins; tile < ends && start(nth, tile) < last; tile += 1) {
        const [left, right] = [X(start(nth, tile)), X(tiles[tile].units[nth][0])];
        if (right === left) continue;
        context.fillRect(Math.min(right, LEFT + wide()) - 0.5, top, 1, ROW - 6);
        const middle = (Math.max(left, LEFT) + Math.min(right, LEFT + wide())) / 2;
        if (Math.min(right, LEFT + wide()) - Math.max(left, LEFT) > 42) {
          context.lineWidth = 3;
          context.strokeStyle = ink('ground');
          const text = `${tiles[tile].column},${tiles[tile].row}`;
          context.strokeText(text, middle, top + 14);
          context.fillText(text, middle, top + 14);
        }
      }
    });
    if (chosen !== null) {
      context.strokeStyle = ink('ink');
      context.lineWidth = 2;
      names.forEach((_, nth) => {
        const [left, right] = [X(start(nth, chosen)), X(tiles[chosen].units[nth][0])];
        const [a, b] = [Math.max(left, LEFT), Math.min(right, LEFT + wide())];
        if (b >= a) context.strokeRect(a, HEAD + nth * ROW, Math.max(b - a, 1), ROW - 6);
      });
    }
    context.fillStyle = ink('faint');
    const y = HEAD + names.length * ROW + 12;
    [[0, 'left'], [0.5, 'center'], [1, 'right']].forEach(([part, align]) => {
      context.textAlign = align;
      context.fillText(readable(Math.round(first + (last - first) * part)), LEFT + wide() * part, y);
    });
    context.textAlign = 'center';
    context.fillText('cycle', LEFT + wide() / 2, y + 18);
  };
  const zoom = (factor, middle = (first + last) / 2) => {
    const span = Math.max(16, Math.min(end - from, (last - first) * factor)), part = (middle - first) / (last - first);
    first = Math.max(from, Math.min(end - span, middle - span * part));
    last = first + span;
    draw();
  };
  const pan = part => {
    const span = last - first;
    first = Math.max(from, Math.min(end - span, first + span * part));
    last = first + span;
    draw();
  };
  const describe = tile => {
    const { column, row, entries, done, cycles, units } = tiles[tile];
    const of = names.map((name, nth) => `${name} ${readable(units[nth][1])}`).join(', ');
    readout.textContent = `Tile ${column},${row}: ${readable(entries)} splats, ${readable(cycles)} cycles, done in cycle ${readable(done)}; busy: ${of}.`;
  };
  const choose = tile => {
    chosen = Math.max(0, Math.min(tiles.length - 1, tile));
    const begins = Math.min(...names.map((_, nth) => start(nth, chosen))), ends = Math.max(tiles[chosen].done, ...tiles[chosen].units.map(([until]) => until));
    const span = Math.max(16, (ends - begins) * 1.3);
    first = Math.max(from, (begins + ends - span) / 2);
    last = Math.min(end, first + span);
    if (last - first < 16) [first, last] = [from, end];
    describe(chosen);
    draw();
  };
  const whole = () => { [first, last] = [from, end]; draw(); };
  const longest = () => choose(tiles.reduce((most, tile, nth) => tile.cycles > tiles[most].cycles ? nth : most, 0));
  const step = by => choose((chosen ?? -1) + by);

  const under = event => {
    const box = canvas.getBoundingClientRect(), nth = Math.floor((event.clientY - box.top - HEAD) / ROW);
    if (nth < 0 || nth >= names.length || event.clientX - box.left < LEFT) return null;
    const cycle = cycleAt(event.clientX - box.left), tile = tileAt(nth, cycle);
    return tile < tiles.length ? { nth, tile, cycle } : null;
  };
  let down = null;
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    zoom(Math.exp(event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), cycleAt(event.clientX - canvas.getBoundingClientRect().left));
  }, { passive: false });
  canvas.addEventListener('pointerdown', event => { canvas.setPointerCapture(event.pointerId); down = { x: event.clientX, moved: 0 }; });
  canvas.addEventListener('pointermove', event => {
    if (down) {
      pan((down.x - event.clientX) / wide());
      down = { x: event.clientX, moved: down.moved + Math.abs(down.x - event.clientX) };
      return;
    }
    const found = under(event);
    if (!found) { tip.hide(); return; }
    const { column, row, units } = tiles[found.tile], [, ...states] = units[found.nth];
    tip.show(event.clientX, event.clientY, h('b', {}, `${names[found.nth]}, tile ${column},${row}`), STATES.map((state, at) => `${state} ${readable(states[at])}`).join(', '));
  });
  canvas.addEventListener('pointerup', event => {
    if (down && down.moved < 4) { const found = under(event); if (found) choose(found.tile); }
    down = null;
  });
  canvas.addEventListener('pointercancel', () => { down = null; });
  canvas.addEventListener('pointerleave', tip.hide);
  canvas.addEventListener('keydown', event => {
    const act = { ArrowLeft: () => pan(-0.2), ArrowRight: () => pan(0.2), '+': () => zoom(0.5), '=': () => zoom(0.5), '-': () => zoom(2), Home: whole, n: () => step(1), p: () => step(-1), l: longest }[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    act();
    event.preventDefault();
    event.stopPropagation();
  });
  onWidth(canvas, draw);
  onColours(draw);
  if (lookedAtTile) {
    const tile = tiles.findIndex(({ column, row }) => column === lookedAtTile[0] && row === lookedAtTile[1]);
    if (tile >= 0) choose(tile);
  }
  return h('div', { id: 'tiles' },
    h('div', { class: 'tools' }, h('button', { onclick: whole }, 'all', h('kbd', {}, 'Home')), h('button', { onclick: () => zoom(0.5) }, 'zoom in', h('kbd', {}, '+')), h('button', { onclick: () => zoom(2) }, 'zoom out', h('kbd', {}, '−')),
      h('button', { onclick: () => step(-1) }, 'previous tile', h('kbd', {}, 'p')), h('button', { onclick: () => step(1) }, 'next tile', h('kbd', {}, 'n')), h('button', { id: 'longest', onclick: longest }, 'longest tile', h('kbd', {}, 'l'))),
    canvas, readout);
};
