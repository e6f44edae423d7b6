// Sequence: frames of a path of cameras, one at a time or as an animation, with their figures below.
'use strict';

const sequencePage = ({ sequence }) => {
  const { report, kinds } = sequence, { frames, scene, machine, spreads, flicker } = report;
  const name = (frame, kind) => `frame_${String(frame).padStart(4, '0')}_${kind}.png`;
  const state = { frame: 0, playing: null };
  const loaded = new Map();
  const db = value => value === null ? 'equal' : readable(value, 4);
  const percent = value => value === null || value === undefined ? '–' : readable(100 * value, 3) + ' %';
  const status = h('p', { class: 'faint', role: 'status' });
  const panes = kinds.map(kind => {
    const canvas = h('canvas', { width: scene.width, height: scene.height, class: 'pixels', role: 'img', 'aria-label': kind });
    return { kind, canvas, figure: h('figure', { class: 'plot' }, h('figcaption', {}, kind), canvas) };
  });
  const readout = h('p', { id: 'frame-says', 'aria-live': 'polite' });
  const slider = h('input', { type: 'range', min: '0', max: String(frames.length - 1), value: '0', 'aria-label': 'frame', oninput: () => show(Number(slider.value)) });

  // A few frames around the current one are kept.
  const picture = (frame, kind) => {
    const key = name(frame, kind);
    if (!loaded.has(key)) {
      if (loaded.size > 60) loaded.delete(loaded.keys().next().value);
      loaded.set(key, source.picture(key));
    }
    return loaded.get(key);
  };
  const show = async frame => {
    state.frame = frame;
    slider.value = String(frame);
    const { cycles, frames_per_second: rate, bottleneck, accuracy, against, flicker } = frames[frame];
    readout.textContent = `Frame ${frame} of ${frames.length}: ${readable(cycles)} cycles, ${readable(rate, 4)} frames/s, limited by ${bottleneck}; fixed − golden ${db(accuracy.fixed_vs_golden.psnr_db)} dB, golden − ideal ${db(accuracy.golden_vs_ideal.psnr_db)} dB`
      + (against ? `; against ${against.picture}: golden ${db(against.golden.psnr_db)} dB, fixed ${db(against.fixed.psnr_db)} dB` : '')
      + (flicker ? `; jumps since the previous frame: fixed − golden ${percent(flicker.fixed_vs_golden.jumps)}, golden − ideal ${percent(flicker.golden_vs_ideal.jumps)} of ${readable(flicker.still_pixels)} still pixels.` : '.');
    try {
      const bitmaps = await Promise.all(panes.map(({ kind }) => picture(frame, kind)));
      // Another frame may have been requested in the meantime.
      if (state.frame === frame) panes.forEach(({ canvas }, nth) => {
        const context = canvas.getContext('2d');
        context.clearRect(0, 0, canvas.width, canvas.height);
        context.drawImage(bitmaps[nth], 0, 0);
      });
    } catch (error) {
      stop();
      status.textContent = `Frame ${frame} cannot be shown: ${error.message}`;
      status.className = 'wrong';
    }
  };
  const step = by => show((state.frame + by + frames.length) % frames.length);
  const stop = () => { clearInterval(state.playing); state.playing = null; play.setAttribute('aria-pressed', 'false'); };
  const start = () => { state.playing = setInterval(() => play.offsetParent ? step(1) : stop(), 1000 / 12); play.setAttribute('aria-pressed', 'true'); };
  const play = h('button', { 'aria-pressed': 'false', onclick: () => state.playing ? stop() : start() }, 'play', h('kbd', {}, 'p'));
  document.addEventListener('keydown', event => {
    if (!play.isConnected || !play.offsetParent || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest('input, select, textarea, summary, a, .scroll, [role=tab]')) return;
    const act = { ArrowLeft: () => step(-1), ArrowRight: () => step(1), p: () => play.click(), Home: () => show(0) }[event.key];
    if (!act) return;
    act();
    event.preventDefault();
  });
  show(0);
  const spread = (title, { worst, percentile_99: most, median }, text) => [title, text(worst), text(most), text(median)];
  const change = (title, { mean, jumps }) => [title, mean === null ? '–' : readable(255 * mean, 3), percent(jumps)];
  return [
    h('p', {}, `${scene.name} on ${machine.description.name}, ${scene.width}×${scene.height}, ${readable(frames.length)} frames of ${readable(scene.splats)} splats.`),
    panes.length ? [h('div', { class: 'tools' }, play, h('button', { onclick: () => step(-1) }, 'previous frame', h('kbd', {}, '←')), h('button', { onclick: () => step(1) }, 'next frame', h('kbd', {}, '→'))), slider] : h('p', { class: 'faint' }, 'The folder has no pictures of frames.'),
    readout, status, h('div', { class: 'plots' }, panes.map(({ figure }) => figure)),
    h('h2', {}, 'All frames'),
    table(['', 'worst', '99 % of frames', 'median'], [
      spread('frames/s', spreads.frames_per_second, value => readable(value, 4)),
      ...[['fixed − golden', 'fixed_vs_golden'], ['golden − ideal', 'golden_vs_ideal'], ['fixed − ideal', 'fixed_vs_ideal']].map(([title, key]) => spread(`${title}, dB`, spreads[key + '_psnr_db'], db)),
    ]),
    report.against ? [h('h2', {}, 'Against photographs'), h('p', { class: 'faint' }, `Code values; means of ${readable(frames.length)} frames. Those of each frame are under Rows.`), againstTable(report.against, 'infinite')] : [],
    flicker ? [h('h2', {}, 'Flicker'), h('p', { class: 'faint' }, `At ${readable(flicker.still_pixels)} still pixels of ${readable(flicker.covered_pixels)} covered ones, frame to frame.`),
      table(['', 'mean change, 1/255', 'jumps > 4/255'], [change('fixed − golden', flicker.fixed_vs_golden), change('golden − ideal', flicker.golden_vs_ideal), change('fixed − ideal', flicker.fixed_vs_ideal)])] : [],
  ].flat(2);
};
