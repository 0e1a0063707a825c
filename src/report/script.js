"use strict";
// Moves, sorts and filters the contents of the page; every number is written by isoflop.

const at = (id) => document.getElementById(id);

function cell(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

/** The slider over a generator's predictions, and the parts that it updates. */
function slider(study) {
  const part = (name) => study.querySelector(`.${name}`);
  const data = JSON.parse(part("predictions").textContent);
  const budget = part("budget");

  const show = (place) => {
    const { flops, far, rows, shape, together, warnings } = data[place];
    part("flops").textContent = flops;
    budget.setAttribute("aria-valuetext", `${flops} FLOPs`);
    part("far").textContent = far;
    part("build").textContent = shape ?? "";
    part("together").textContent = together ?? "";
    part("configuration").replaceChildren(...rows.map(([name, value, interval]) => {
      const row = document.createElement("tr");
      const head = cell("th", name);
      head.scope = "row";
      row.append(head, cell("td", value), cell("td", interval));
      return row;
    }));
    part("cautions").replaceChildren(...warnings.map((warning) => cell("li", warning)));
    const places = (name) => part(name)?.dataset.places.split(",")[place]?.split(" ").map(Number);
    const mark = places("mark");
    if (mark) {
      part("mark").setAttribute("cx", mark[0]);
      part("mark").setAttribute("cy", mark[1]);
    }
    const optimum = places("optimum");
    if (optimum && optimum.every(Number.isFinite)) {
      const [middle, low, high] = optimum;
      const [band, line] = part("optimum").children;
      band.setAttribute("x", low);
      band.setAttribute("width", high - low);
      line.setAttribute("x1", middle);
      line.setAttribute("x2", middle);
    }
  };

  const move = () => show(Number(budget.value));
  /** `report.html#1e12` selects the nearest budget. */
  const follow = () => {
    const asked = Math.log(Number(location.hash.slice(1)));
    if (Number.isFinite(asked)) {
      const far = data.map(({ budget_flops }) => Math.abs(Math.log(budget_flops) - asked));
      budget.value = far.indexOf(Math.min(...far));
    }
    move();
  };
  budget.addEventListener("input", move);
  addEventListener("hashchange", follow);
  follow();
}

for (const study of document.querySelectorAll(".study")) {
  if (study.querySelector(".predictions")) slider(study);
}

for (const kind of ["pointerover", "click"]) {
  document.addEventListener(kind, (event) => {
    const label = event.target.dataset?.label;
    const pointed = label && event.target.closest(".study")?.querySelector(".pointed");
    if (pointed) pointed.textContent = label;
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

  /** Whether every word occurs in a cell; `V=128` must be in the cell of that column. */
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
