// Frame: pictures of a run side by side or under a slider with linked zoom and pan, the value under the pointer, and a pixel trace on a click.
'use strict';

const framePage = folder => {
  const { report, pictures: files, machine_name: machineName, scene, preview_of: previewOf } = folder.run;
  const { width, height } = report.scene;
  const maps = source.live ? ['bound', 'covered', 'contributions', 'layers', 'merges'] : [];
  const names = [...files, ...maps, ...(folder.tiles ? ['cycles'] : [])];
  const TITLES = {
    fixed: 'fixed: picture of the machine', golden: 'golden: the same rules in exact arithmetic', ideal: 'ideal: exact, without a limit of layers',
    error: `error: |fixed − golden| × ${readable(report.error_scale)}`, flips: 'flips: decisions that golden takes differently',
    bound: 'bound on the error of arithmetic', covered: 'covered: pixels that a splat touches', contributions: 'contributions per pixel',
    layers: 'layers per pixel at the end', merges: 'merges per pixel', cycles: 'cycles per tile, over the picture',
  };
  const FLIPS = { cull: '#ffffff', coverage: '#00b3ff', slot: '#ff5900', order: '#ffe100', pair: '#f359f3', eviction: '#00e67c', turn: '#aaf3f3', late: '#cbaa7c', inside: '#ffcbda', window: '#bcbcff', sum: '#dbffaa' };
  // Cividis (Nuñez and others, 2018): lightness grows with the value; suitable for colour-blind readers.
  const RAMP = [[0, 32, 76], [0, 42, 102], [62, 70, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [255, 233, 69]];
  const ramp = part => {
    const at = Math.max(0, Math.min(0.9999, part)) * (RAMP.length - 1), low = Math.floor(at);
    return RAMP[low].map((from, channel) => Math.round(from + (RAMP[low + 1][channel] - from) * (at - low)));
  };

  const state = { show: [names[0], names[1] ?? names[0]], mode: names.length > 1 ? 'two' : 'one', scale: 0, x: width / 2, y: height / 2, split: 0.5, pixel: null };
  const loaded = new Map();
  const status = h('p', { class: 'faint', role: 'status' });

  // ---- Pictures ----

  const load = async name => {
    if (name === 'cycles') {
      const tiles = await foldersTiles(folder), { side } = tiles;
      const values = new Float32Array(width * height);
      tiles.tiles.forEach(({ column, row, cycles }) => {
        const [right, bottom] = [Math.min((column + 1) * side, width), Math.min((row + 1) * side, height)];
        for (let y = row * side; y < bottom; y += 1) values.fill(cycles, y * width + column * side, y * width + Math.max(column * side, right));
      });
      const heat = coloured(name, values), canvas = new OffscreenCanvas(width, height), context = canvas.getContext('2d');
      if (files.includes('fixed')) {
        context.filter = 'grayscale(1)';
        context.drawImage(await source.picture('fixed.png'), 0, 0);
        context.filter = 'none';
        context.globalAlpha = 0.7;
      }
      context.drawImage(heat.bitmap, 0, 0);
      return { ...heat, bitmap: canvas };
    }
    if (maps.includes(name)) {
      status.textContent = 'Drawing the frame again, for data that its files do not contain …';
      const values = await source.floats('map/' + name);
      status.textContent = '';
      return coloured(name, values);
    }
    return { bitmap: await source.picture(name + '.png') };
  };
  const coloured = (name, values) => {
    let least = Infinity, most = 0;
    for (const value of values) {
      if (value > most && Number.isFinite(value)) most = value;
      if (value > 0 && value < least) least = value;
    }
    const log = name === 'bound' && most > 0;
    // Magnitudes of an error are powers of ten; counts begin at 0.
    const from = log ? Math.log10(Math.max(least, most * 1e-6)) : 0, to = log ? Math.log10(most) : most;
    const canvas = new OffscreenCanvas(width, height), data = new ImageData(width, height);
    const steps = Array.from({ length: 257 }, (_, step) => ramp(step / 256));
    for (let at = 0; at < values.length; at += 1) {
      const value = values[at], place = log ? (value > 0 ? Math.log10(value) : -Infinity) : value;
      const part = !Number.isFinite(value) ? 1 : to > from ? (place - from) / (to - from) : place > 0 ? 1 : 0;
      const [r, g, b] = steps[Math.round(256 * Math.max(0, Math.min(1, part)))];
      data.data.set([r, g, b, 255], 4 * at);
    }
    canvas.getContext('2d').putImageData(data, 0, 0);
    return { bitmap: canvas, legend: [log ? Math.pow(10, from) : 0, most, log] };
  };
  const want = name => {
    if (loaded.has(name)) return loaded.get(name).bitmap ? loaded.get(name) : null;
    loaded.set(name, {});
    load(name).then(picture => { loaded.set(name, picture); draw(); }, error => {
      loaded.delete(name);
      status.textContent = `${name} cannot be shown: ${error.message}`;
      status.className = 'wrong';
    });
    return null;
  };

  // ---- Panes ----

  const stage = h('div', { class: 'stage' });
  const panes = [0, 1].map(nth => {
    const canvas = h('canvas', { tabindex: '0', role: 'img', 'aria-label': nth ? 'right picture' : 'left picture' });
    const caption = h('figcaption');
    return { canvas, caption, figure: h('figure', {}, caption, canvas) };
  });
  const slider = h('input', { type: 'range', min: '0', max: '1000', value: '500', 'aria-label': 'position of the slider', oninput: () => { state.split = slider.value / 1000; draw(); } });
  const legend = h('div', { class: 'legend' });

  const fit = () => {
    const { canvas } = panes[0];
    state.scale = Math.min(canvas.clientWidth / width, canvas.clientHeight / height) || 1;
    [state.x, state.y] = [width / 2, height / 2];
    draw();
  };
  let wanted = 0;
  const draw = () => { cancelAnimationFrame(wanted); wanted = requestAnimationFrame(paint); };
  const paint = () => {
    const shown = state.mode === 'two' ? panes : panes.slice(0, 1);
    if (!shown[0].canvas.clientWidth) return;
    if (!state.scale) return fit();
    shown.forEach((pane, nth) => paintPane(pane, nth));
    legend.replaceChildren(...legends());
  };
  const paintPane = ({ canvas, caption }, nth) => {
    const ratio = devicePixelRatio || 1, [columns, rows] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(columns * ratio) || canvas.height !== Math.round(rows * ratio)) {
      [canvas.width, canvas.height] = [Math.round(columns * ratio), Math.round(rows * ratio)];
    }
    const context = canvas.getContext('2d'), { scale } = state;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, columns, rows);
    // Enlarged, a pixel is a square.
    context.imageSmoothingEnabled = scale * ratio < 1;
    context.imageSmoothingQuality = 'high';
    const [left, top] = [columns / 2 - state.x * scale, rows / 2 - state.y * scale];
    const put = name => { const picture = want(name); if (picture) context.drawImage(picture.bitmap, left, top, width * scale, height * scale); };
    if (state.mode === 'slider') {
      const cut = columns * state.split;
      [[0, cut, state.show[0]], [cut, columns - cut, state.show[1]]].forEach(([from, wide, name]) => {
        context.save();
        context.beginPath();
        context.rect(from, 0, wide, rows);
        context.clip();
        put(name);
        context.restore();
      });
      context.fillStyle = ink('c1');
      context.fillRect(cut - 1, 0, 2, rows);
      caption.textContent = `left of the line ${TITLES[state.show[0]]}; right of it ${TITLES[state.show[1]]}`;
    } else {
      put(state.show[nth]);
      caption.textContent = TITLES[state.show[nth]];
    }
    if (state.pixel) {
      const [x, y] = state.pixel, side = Math.max(scale, 7);
      const [px, py] = [left + (x + 0.5) * scale - side / 2, top + (y + 0.5) * scale - side / 2];
      [['#000', 3], ['#fff', 1]].forEach(([style, line]) => {
        context.strokeStyle = style;
        context.lineWidth = line;
        context.strokeRect(px - 1, py - 1, side + 2, side + 2);
      });
    }
  };
  const legends = () => [...new Set(state.mode === 'one' ? state.show.slice(0, 1) : state.show)].flatMap(name => {
    const scale = loaded.get(name)?.legend;
    if (scale) {
      const bar = h('span', { class: 'scale' });
      bar.style.background = `linear-gradient(to right, ${RAMP.map(stop => `rgb(${stop})`).join(', ')})`;
      return [h('span', {}, `${name}: ${readable(scale[0], 3)} `, bar, ` ${readable(scale[1], 3)}${scale[2] ? ', log scale' : ''}`)];
    }
    if (name !== 'flips') return [];
    const counts = report.accuracy?.lockstep?.flips ?? {};
    return Object.entries(FLIPS).filter(([kind]) => counts[kind] > 0).map(([kind, shown]) => {
      const box = h('i');
      box.style.background = shown;
      return h('span', {}, box, `${kind} ${readable(counts[kind])}`);
    });
  });

  const layout = () => {
    stage.className = 'stage ' + (state.mode === 'two' ? 'two' : 'one');
    stage.replaceChildren(...(state.mode === 'two' ? panes : panes.slice(0, 1)).map(pane => pane.figure));
    slider.hidden = state.mode !== 'slider';
    modes.forEach((button, mode) => button.setAttribute('aria-pressed', String(mode === state.mode)));
    choices.forEach((buttons, side) => buttons.forEach((button, name) => button.setAttribute('aria-pressed', String(state.show[side] === name))));
    sides[1].hidden = state.mode === 'one';
    draw();
  };

  // ---- Position of the pointer ----

  const at = (canvas, event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left - box.width / 2) / state.scale + state.x, (event.clientY - box.top - box.height / 2) / state.scale + state.y];
  };
  const pixelAt = (canvas, event) => {
    const [x, y] = at(canvas, event).map(Math.floor);
    return x >= 0 && y >= 0 && x < width && y < height ? [x, y] : null;
  };
  const zoom = (factor, [x, y] = [state.x, state.y]) => {
    const scale = Math.max(0.02, Math.min(128, state.scale * factor));
    // The point under the pointer stays in place.
    state.x = x + (state.x - x) * state.scale / scale;
    state.y = y + (state.y - y) * state.scale / scale;
    state.scale = scale;
    draw();
  };
  panes.forEach(({ canvas }) => {
    const down = new Map();
    let moved = 0;
    canvas.addEventListener('wheel', event => { event.preventDefault(); zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), at(canvas, event)); }, { passive: false });
    canvas.addEventListener('pointerdown', event => { canvas.setPointerCapture(event.pointerId); down.set(event.pointerId, [event.clientX, event.clientY]); moved = down.size > 1 ? 99 : 0; });
    canvas.addEventListener('pointermove', event => {
      const before = down.get(event.pointerId);
      if (!before) { hover(pixelAt(canvas, event)); return; }
      const now = [event.clientX, event.clientY], step = [now[0] - before[0], now[1] - before[1]];
      moved += Math.abs(step[0]) + Math.abs(step[1]);
      if (down.size === 2) {
        const other = [...down].find(([id]) => id !== event.pointerId)[1];
        const length = point => Math.hypot(point[0] - other[0], point[1] - other[1]);
        zoom(length(now) / Math.max(1, length(before)), at(canvas, event));
      } else if (moved > 4) {
        state.x -= step[0] / state.scale;
        state.y -= step[1] / state.scale;
        draw();
      }
      down.set(event.pointerId, now);
    });
    const up = event => {
      const was = down.delete(event.pointerId);
      if (was && moved <= 4 && event.type === 'pointerup') choose(pixelAt(canvas, event));
    };
    canvas.addEventListener('pointerup', up);
    canvas.addEventListener('pointercancel', up);
    canvas.addEventListener('pointerleave', () => hover(null));
  });

  // ---- Values ----

  const values = h('div', { id: 'values', 'aria-live': 'polite' }, h('p', { class: 'faint' }, 'Values of the pixel under the pointer are shown here; a click shows its pixel trace.'));
  let asking = false, next;
  const hover = pixel => {
    // Pixels under a moving pointer are not read aloud.
    values.setAttribute('aria-live', 'off');
    read(pixel ?? state.pixel);
  };
  // One request at a time, only for the last pixel.
  const read = async pixel => {
    next = pixel;
    if (asking || !pixel) return;
    asking = true;
    const waiting = setTimeout(() => values.replaceChildren(h('p', { class: 'faint', role: 'status' }, 'Drawing the frame again, for exact values …')), 250);
    while (next) {
      const [x, y] = next;
      next = null;
      try {
        values.replaceChildren(...(source.live ? exact(await source.json(`pixel?x=${x}&y=${y}`)) : await shown(x, y)), ...await ofTile(x, y));
      } catch (error) {
        values.replaceChildren(h('p', { class: 'wrong' }, 'No exact values: ' + error.message), ...await shown(x, y));
      }
      clearTimeout(waiting);
    }
    asking = false;
  };
  const four = (name, numbers, text) => [name, ...numbers.map(text)];
  const exact = pixel => [
    h('h3', {}, `Pixel ${pixel.x},${pixel.y}`),
    h('p', { class: 'faint' }, pixel.encoded ? 'Values for a screen (sRGB), not linear light; colour times opacity.' : 'Linear light, colour times opacity.'),
    table(['', 'red', 'green', 'blue', 'alpha'], [
      ...['fixed', 'golden', 'ideal'].map(name => four(name, pixel[name], value => value.toFixed(6))),
      four('fixed − golden', pixel.error, value => value.toExponential(2)),
      four('… in ulp', pixel.error_ulp, value => readable(value, 3)),
      four('… in 1/255', pixel.error_255, value => readable(value, 3)),
      four(`word, ${pixel.format}`, pixel.words, word => word.toString(16)),
    ]),
    h('p', {}, `Contributions ${pixel.contributions}, layers ${pixel.layers}, merges ${pixel.merges}; bound ${pixel.bound === null ? 'none' : readable(255 * pixel.bound, 3) + '/255'}; flips: ${pixel.flips.join(', ') || 'none'}.`),
  ];
  const ofTile = async (x, y) => {
    if (!folder.tiles) return [];
    const tiles = await foldersTiles(folder).catch(() => null), tile = tiles?.at(x, y);
    if (!tiles) return [];
    if (!tile) return [h('p', {}, 'Its tile has no splats.')];
    return [h('p', { id: 'tile' }, `Tile ${tile.column},${tile.row}: ${readable(tile.cycles)} cycles, ${readable(tile.entries)} splats. `, h('button', { onclick: () => { lookedAtTile = [tile.column, tile.row]; location.hash = '#machine'; document.dispatchEvent(new Event('tile')); } }, 'its timeline'))];
  };
  const linear = code => code <= 0.04045 ? code / 12.92 : Math.pow((code + 0.055) / 1.055, 2.4);
  const shown = async (x, y) => {
    const rows = ['fixed', 'golden', 'ideal'].filter(name => loaded.get(name)?.bitmap ?? want(name)).map(name => {
      const canvas = new OffscreenCanvas(1, 1), context = canvas.getContext('2d');
      context.drawImage(loaded.get(name).bitmap, x, y, 1, 1, 0, 0, 1, 1);
      const [r, g, b, a] = context.getImageData(0, 0, 1, 1).data;
      return [name, ...[r, g, b].map(code => (linear(code / 255) * a / 255).toFixed(4)), (a / 255).toFixed(4)];
    });
    return [h('h3', {}, `Pixel ${x},${y}`), h('p', { class: 'faint' }, 'From the 8 bits of the pictures, as linear light; splatsim view shows exact values.'), table(['', 'red', 'green', 'blue', 'alpha'], rows)];
  };

  // ---- The pixel trace ----

  const story = h('div', { id: 'story' });
  let soon = 0, telling = false, nextStory;
  const choose = (pixel, delay = 0) => {
    if (!pixel) return;
    state.pixel = pixel;
    draw();
    values.setAttribute('aria-live', 'polite');
    read(pixel);
    clearTimeout(soon);
    soon = setTimeout(() => tell(pixel), delay);
  };
  // One request at a time, only for the last pixel: each draws a frame.
  const tell = async pixel => {
    if (!source.live) {
      const [x, y] = pixel;
      story.replaceChildren(h('h2', {}, `Pixel ${x},${y}`), h('p', {}, 'This command prints its pixel trace:'), repeated(x, y));
      return;
    }
    nextStory = pixel;
    if (telling) return;
    telling = true;
    story.setAttribute('aria-busy', 'true');
    while (nextStory) {
      const [x, y] = nextStory;
      nextStory = null;
      const waiting = setTimeout(() => story.replaceChildren(h('p', { class: 'faint', role: 'status' }, `Pixel ${x},${y}: drawing the frame again, for its trace …`)), 250);
      try {
        const found = await source.json(`story?x=${x}&y=${y}`);
        clearTimeout(waiting);
        if (!nextStory) story.replaceChildren(...[attempt(() => traceOf(found, repeated(x, y)))].flat());
      } catch (error) {
        clearTimeout(waiting);
        if (!nextStory) story.replaceChildren(h('p', { class: 'wrong' }, 'No pixel trace: ' + error.message));
      }
    }
    telling = false;
    story.removeAttribute('aria-busy');
  };
  const machineFile = report.machine.description.name.replace(/[^\w.-]/g, '_') + '.json';
  const repeated = (x, y) => {
    const whole = previewOf ? [Math.floor(previewOf[0] / 4), Math.floor(previewOf[1] / 4)] : [width, height];
    const command = `splatsim explain ${quoted(scene)} --pixel ${x},${y} --size ${whole.join('x')} --machine ${quoted(machineName ?? machineFile)}`;
    const file = machineName ? [] : [h('button', { onclick: () => save(machineFile, JSON.stringify(report.machine.description, null, 2)) }, `save ${machineFile}`)];
    return h('div', {}, h('div', { class: 'code', id: 'command' }, command), h('div', { class: 'tools' }, copying(command), ...file));
  };

  // ---- Buttons and keys ----

  const key = at => names[at] === 'cycles' ? 'c' : String((at + 1) % 10);
  const choices = [0, 1].map(side => new Map(names.map((name, at) => [name, h('button', { onclick: () => pick(side, name) }, name, h('kbd', {}, (side ? '⇧' : '') + key(at)))])));
  const pick = (side, name) => { state.show[side] = name; if (side && state.mode === 'one') state.mode = 'two'; layout(); };
  const sides = choices.map((buttons, side) => h('div', { class: 'tools choices', role: 'group', 'aria-label': side ? 'right picture' : 'left picture' }, h('span', {}, side ? 'right' : 'left'), ...buttons.values()));
  const setMode = mode => { state.mode = mode; state.scale = 0; layout(); };
  const modes = new Map([['one', 'o'], ['two', 't'], ['slider', 's']].map(([mode, letter]) => [mode, h('button', { onclick: () => setMode(mode) }, mode === 'two' ? 'side by side' : mode === 'one' ? 'one' : 'slider', h('kbd', {}, letter))]));
  // The brightest pixels of the error, in sequence.
  let worst = null, nth = 0;
  const toWorst = async () => {
    if (!worst) {
      const canvas = new OffscreenCanvas(width, height), context = canvas.getContext('2d');
      context.drawImage(await source.picture('error.png'), 0, 0);
      const { data } = context.getImageData(0, 0, width, height);
      const bright = [];
      let least = 0;
      for (let at = 0; at < width * height; at += 1) {
        const sum = data[4 * at] + data[4 * at + 1] + data[4 * at + 2];
        if (sum > least) {
          bright.push([sum, at]);
          if (bright.length > 400) { bright.sort((a, b) => b[0] - a[0] || a[1] - b[1]).splice(100); least = bright[99][0]; }
        }
      }
      worst = bright.sort((a, b) => b[0] - a[0] || a[1] - b[1]).slice(0, 100).map(([, at]) => [at % width, Math.floor(at / width)]);
    }
    if (!worst.length) { status.textContent = 'fixed and golden show no difference.'; return; }
    const pixel = worst[nth % worst.length];
    nth += 1;
    [state.x, state.y] = pixel.map(place => place + 0.5);
    state.scale = Math.max(state.scale, 12);
    choose(pixel);
  };
  const whole = h('div', { class: 'tools' }, h('span', {}, 'view'), ...modes.values(),
    h('button', { onclick: fit }, 'fit', h('kbd', {}, 'f')), h('button', { onclick: () => { state.scale = 1; draw(); } }, '1:1', h('kbd', {}, 'z')),
    h('button', { onclick: () => zoom(2) }, 'zoom in', h('kbd', {}, '+')), h('button', { onclick: () => zoom(0.5) }, 'zoom out', h('kbd', {}, '−')),
    files.includes('error') ? h('button', { id: 'worst', onclick: toWorst }, 'worst pixel', h('kbd', {}, 'w')) : null);

  document.addEventListener('keydown', event => {
    if (!stage.isConnected || !stage.offsetParent || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest('input, select, textarea, summary, a, .scroll, [role=tab]')) return;
    const digit = /^Digit(\d)$/.exec(event.code)?.[1], name = digit ? names[(Number(digit) + 9) % 10] : event.key.toLowerCase() === 'c' && folder.tiles ? 'cycles' : undefined;
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (name) pick(event.shiftKey ? 1 : 0, name);
    else if (step) {
      const far = event.shiftKey ? 10 : 1, from = state.pixel ?? [Math.floor(state.x), Math.floor(state.y)];
      const to = from.map((place, axis) => place + far * step[axis]);
      choose([Math.max(0, Math.min(width - 1, to[0])), Math.max(0, Math.min(height - 1, to[1]))], 120);
      keepInSight();
    } else if (event.key === 'Enter' && event.target.tagName !== 'BUTTON') choose(state.pixel ?? [Math.floor(state.x), Math.floor(state.y)]);
    else {
      const act = { o: () => setMode('one'), t: () => setMode('two'), s: () => setMode('slider'), f: fit, z: () => { state.scale = 1; draw(); }, '+': () => zoom(2), '=': () => zoom(2), '-': () => zoom(0.5), w: () => files.includes('error') && toWorst() }[event.key];
      if (!act) return;
      act();
    }
    event.preventDefault();
  });
  const keepInSight = () => {
    const { canvas } = panes[0], [x, y] = state.pixel;
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight].map(side => 0.45 * side / state.scale);
    state.x = Math.max(x - wide, Math.min(x + wide, state.x));
    state.y = Math.max(y - high, Math.min(y + high, state.y));
  };

  const db = value => value === null ? 'equal' : value.toFixed(1) + ' dB';
  const { fixed_vs_golden: arithmetic, golden_vs_ideal: method, fixed_vs_ideal: both } = report.accuracy;
  const head = h('p', {}, `${report.scene.name} on ${report.machine.description.name}, ${width}×${height}: fixed − golden ${db(arithmetic.psnr_db)}, golden − ideal ${db(method.psnr_db)}${both ? `, fixed − ideal ${db(both.psnr_db)}` : ''}; ${readable(report.accuracy.lockstep?.decision_flips)} flips.`);
  const photograph = report.against ? [h('p', {}, `Against ${report.against.picture}, code values of ${report.against.bits} bits:`), againstTable(report.against)] : [];
  layout();
  onWidth(stage, () => { state.scale = 0; draw(); });
  onColours(draw);
  const keys = h('details', {}, h('summary', {}, 'Keys'), h('p', {}, 'Digits select the left picture, with Shift the right one; c selects the cycles of tiles. Wheel or + and − zoom, dragging pans. Arrows move by a pixel, with Shift by ten; Enter shows the pixel trace. w moves to the brightest pixel of the error, then to the next ones.'));
  return [head, ...photograph, ...sides, whole, h('div', { class: 'columns' }, h('div', {}, stage, slider, legend, status, keys), values), story];
};
