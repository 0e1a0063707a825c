"use strict";
// Moves, sorts and filters what the page holds; every number is written by isoflop.

const at = (id) => document.getElementById(id);

function cell(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

/** Shows the prediction that the slider stands on. */
function predict(predictions, place) {
  const { flops, far, rows, shape, warnings } = predictions[place];
  at("flops").textContent = flops;
  at("budget").setAttribute("aria-valuetext", `${flops} FLOPs`);
  at("far").textContent = far;
  at("build").textContent = shape ?? "";
  at("configuration").replaceChildren(...rows.map(([name, value, interval]) => {
    const row = document.createElement("tr");
    const head = cell("th", name);
    head.scope = "row";
    row.append(head, cell("td", value), cell("td", interval));
    return row;
  }));
  at("cautions").replaceChildren(...warnings.map((warning) => cell("li", warning)));
  const places = (id) => at(id)?.dataset.places.split(",")[place]?.split(" ").map(Number);
  const mark = places("mark");
  if (mark) {
    at("mark").setAttribute("cx", mark[0]);
    at("mark").setAttribute("cy", mark[1]);
  }
  const optimum = places("optimum");
  if (optimum && optimum.every(Number.isFinite)) {
    const [middle, low, high] = optimum;
    const [band, line] = at("optimum").children;
    band.setAttribute("x", low);
    band.setAttribute("width", high - low);
    line.setAttribute("x1", middle);
    line.setAttribute("x2", middle);
  }
}

const predictions = at("predictions");
if (predictions) {
  const data = JSON.parse(predictions.textContent);
  const move = () => predict(data, Number(at("budget").value));
  /** `report.html#1e12` stands on the nearest budget. */
  const follow = () => {
    const asked = Math.log(Number(location.hash.slice(1)));
    if (Number.isFinite(asked)) {
      const far = data.map(({ budget_flops }) => Math.abs(Math.log(budget_flops) - asked));
      at("budget").value = far.indexOf(Math.min(...far));
    }
    move();
  };
  at("budget").addEventListener("input", move);
  addEventListener("hashchange", follow);
  follow();
}

for (const kind of ["pointerover", "click"]) {
  document.addEventListener(kind, (event) => {
    const label = event.target.dataset?.label;
    if (label && at("pointed")) at("pointed").textContent = label;
  });
}

const table = at("table");
if (table) {
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const heads = [...table.tHead.rows[0].cells];

  const key = (row, column) => {
    const { dataset, textContent } = row.cells[column];
    return dataset.value === undefined ? textContent : Number(dataset.value);
  };
  const sort = (column) => {
    const head = heads[column];
    const falls = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", falls ? "descending" : "ascending");
    const order = (a, b) => {
      const [x, y] = [key(a, column), key(b, column)];
      return (x < y ? -1 : x > y ? 1 : 0) * (falls ? -1 : 1);
    };
    body.append(...rows.sort(order));
  };
  heads.forEach((head, column) => head.firstChild.addEventListener("click", () => sort(column)));

  /** Every word stands in a cell; `V=128` in the cell of that column. */
  const fits = (row, word) => {
    const [name, value] = word.split("=");
    const cells = [...row.cells].map((one) => one.textContent.toLowerCase());
    if (value === undefined) return cells.some((text) => text.includes(word));
    const column = heads.findIndex((head) => head.textContent.toLowerCase() === name);
    return column >= 0 && cells[column] === value;
  };
  const filter = () => {
    const words = at("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    rows.forEach((row) => { row.hidden = !words.every((word) => fits(row, word)); });
    const shown = rows.filter((row) => !row.hidden).length;
    at("shown").textContent = `${shown} of ${rows.length}`;
  };
  at("filter").addEventListener("input", filter);
  filter();
}
