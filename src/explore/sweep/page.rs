//! Page: writes figures and rows as one self-contained HTML file that works without a network.

use super::charts::ChartFigure;
use super::table::Table;
use crate::output::text::{json_in_html, plain};
use serde_json::{Value, json};
use std::fmt::Write;

const STYLE: &str = "
body { font: 15px/1.45 system-ui, sans-serif; color: #282828; margin: 2em auto; max-width: 100em; padding: 0 1.5em; }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin: 2.2em 0 .2em } p { max-width: 60em; margin: .3em 0 .8em }
svg { max-width: 100%; height: auto; border: 1px solid #e1e1e1 }
.table { overflow-x: auto } table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums }
th { cursor: pointer; position: sticky; top: 0; background: #fff; border-bottom: 2px solid #999; text-align: left; white-space: nowrap }
th, td { padding: .2em .7em } td { border-bottom: 1px solid #eee; white-space: nowrap; max-width: 40em; overflow: hidden; text-overflow: ellipsis }
td.n { text-align: right } th:after { content: ' ↕'; color: #bbb } th.up:after { content: ' ↑' } th.down:after { content: ' ↓' }
input { font: inherit; width: 24em }
";

/// Sorts by a click on a head, filters rows by typed words, shows the first rows.
const SCRIPT: &str = "
const MOST = 500, { columns, rows } = JSON.parse(document.getElementById('rows').textContent);
const head = document.querySelector('thead tr'), body = document.querySelector('tbody');
const words = document.querySelector('input'), count = document.getElementById('count');
let by = 0, falling = false;
const compare = (a, b) => a === b ? 0 : a === null ? 1 : b === null ? -1 : (a < b ? -1 : 1) * (falling ? -1 : 1);
const show = () => {
  const typed = words.value.toLowerCase().split(/\\s+/).filter(word => word);
  const kept = rows.filter(row => { const text = row.join(' ').toLowerCase(); return typed.every(word => text.includes(word)); });
  kept.sort((a, b) => compare(a[by], b[by]));
  body.replaceChildren(...kept.slice(0, MOST).map(row => {
    const line = document.createElement('tr');
    row.forEach(value => {
      const cell = line.insertCell();
      const number = typeof value === 'number';
      if (number) cell.className = 'n';
      cell.textContent = value === null ? '' : number && !Number.isInteger(value) ? Number(value.toPrecision(5)) : value;
      cell.title = value === null ? '' : value;
    });
    return line;
  }));
  count.textContent = kept.length > MOST ? `the first ${MOST} of ${kept.length} rows` : `${kept.length} rows`;
  [...head.cells].forEach((cell, i) => cell.className = i === by ? (falling ? 'down' : 'up') : '');
};
columns.forEach((name, i) => {
  const cell = document.createElement('th');
  cell.textContent = name;
  cell.onclick = () => { falling = by === i && !falling; by = i; show(); };
  head.append(cell);
});
words.oninput = show;
show();
";

/// The page. Columns with one value in all rows are listed once; keys and host times are omitted.
pub fn html(table: &Table, base: &str, figures: &[(&ChartFigure, String)]) -> String {
    let is_shown = |name: &str| name != "key" && !name.starts_with("host_");
    let all = || {
        table
            .columns
            .iter()
            .enumerate()
            .filter(|(_, (name, _))| is_shown(name))
    };
    let is_same = |at: usize| {
        table.rows.len() > 1 && table.rows.iter().all(|row| row[at] == table.rows[0][at])
    };
    let (same, varied): (Vec<_>, Vec<_>) = all().partition(|(at, _)| is_same(*at));
    let same = same.iter().filter(|(at, _)| !table.rows[0][*at].is_null());
    let same: Vec<String> = same
        .map(|(at, (name, _))| format!("{name} = {}", plain(&table.rows[0][*at])))
        .collect();
    let columns: Vec<&String> = varied.iter().map(|(_, (name, _))| name).collect();
    let rows: Vec<Vec<&Value>> = table
        .rows
        .iter()
        .map(|row| varied.iter().map(|(at, _)| &row[*at]).collect())
        .collect();
    let rows = json_in_html(&json!({"columns": columns, "rows": rows}));
    let name = escaped(base);
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>splatsim: {name}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>Machines made from {name}</h1>\n"
    );
    for (
        ChartFigure {
            name,
            title,
            caption,
            ..
        },
        svg,
    ) in figures
    {
        let _ = write!(
            page,
            "<h2 id=\"{name}\">{}</h2>\n<p>{}</p>\n{svg}\n",
            escaped(title),
            escaped(caption)
        );
    }
    let _ = write!(
        page,
        "<h2 id=\"table\">All rows</h2>\n<p>A click on a head sorts. <input placeholder=\"show rows with these words\"> <span id=\"count\"></span></p>\n\
         <div class=\"table\"><table><thead><tr></tr></thead><tbody></tbody></table></div>\n<p>The same in all rows: {}.</p>\n\
         <script type=\"application/json\" id=\"rows\">{rows}</script>\n<script>{SCRIPT}</script>\n</body>\n</html>\n",
        escaped(&same.join(", "))
    );
    page
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
