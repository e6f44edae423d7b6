// Compare: results of `compare` in a folder: three pictures and the tables.
'use strict';

const comparePage = ({ compare, charts }) => {
  const frame = side => `${side.name}${side.scene ? ` on ${side.scene}, ${side.size.join('×')}` : ''}`;
  const percent = part => `${part > 0 ? '+' : '−'}${readable(Math.abs(100 * part), 3)}%`;
  const step = ({ difference, relative }) => !difference ? '' : relative === undefined ? `${difference > 0 ? '+' : '−'}${readable(Math.abs(difference), 4)}` : percent(relative);
  const field = value => value === null ? 'left out' : typeof value === 'object' ? JSON.stringify(value) : readable(value);
  const figureOf = ({ scale }, value) => readable(typeof value === 'number' && scale ? value * scale : value, 6);
  const section = (title, heads, rows) => rows.length ? [h('h3', {}, title), table(heads, rows)] : [];
  const side = (unit, of) => unit[of].cycles ?? Array(4).fill(null);
  const differ = compare.units.filter(unit => JSON.stringify(unit.a.cycles) !== JSON.stringify(unit.b.cycles));
  const pictures = [['a.png', 'A'], ['b.png', 'B'], ['difference.png', `|A − B| × ${readable(compare.difference_scale)}`]].filter(([name]) => charts.includes(name));
  return [
    h('p', {}, h('b', {}, 'A: '), frame(compare.a), h('br'), h('b', {}, 'B: '), frame(compare.b)),
    compare.equal ? h('p', {}, 'Nothing differs.') : null,
    h('div', { class: 'plots' }, pictures.map(([name, title]) => h('figure', { class: 'plot' }, h('img', { class: 'pixels', src: source.file(name), alt: title }), h('figcaption', {}, title)))),
    ...section('Figures', ['', 'A', 'B', 'B against A'], compare.figures.map(figure => [figure.name, figureOf(figure, figure.a), figureOf(figure, figure.b), step(figure)])),
    ...section('Cycles of units that differ', ['', ...['busy', 'starved', 'blocked', 'memory'].flatMap(state => [state + ' A', 'B'])], differ.map(unit => [unit.name, ...[0, 1, 2, 3].flatMap(state => [readable(side(unit, 'a')[state]), readable(side(unit, 'b')[state])])])),
    ...section('Machine', ['', 'A', 'B'], compare.machine.map(one => [one.field, field(one.a), field(one.b)])),
    ...section('Scene', ['', 'A', 'B'], compare.scene.map(one => [one.field, field(one.a), field(one.b)])),
    ...section('Pictures of A against those of B', ['', 'PSNR dB', 'SSIM', 'max error', 'pixels that differ'], compare.pictures.map(pair => [pair.name, pair.psnr_db === null ? 'equal' : readable(pair.psnr_db), readable(pair.ssim), readable(pair.max_error), readable(pair.pixels_that_differ)])),
  ].filter(Boolean);
};
