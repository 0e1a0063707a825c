"use strict";
// Skeletons on a canvas. Positions are millimetres; y points up.
{
  const { parents, samples } = JSON.parse(document.getElementById("motions").textContent);
  const [chooser, stage, play, scrub, maker, source] =
    ["sample", "stage", "play", "frame", "maker", "source"].map((id) => document.getElementById(id));
  const joints = parents.length;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let [shown, bodies, size, turn, playing, began] = [samples[0], [], 1, 0.6, !still, 0];

  const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  /** Numbers in base64 VLQ, each the change from the same coordinate in the frame before. */
  const unpacked = (text) => {
    const mm = [];
    let [value, shift] = [0, 0];
    for (const letter of text) {
      const digit = digits.indexOf(letter);
      value |= (digit & 31) << shift;
      shift += 5;
      if (digit & 32) continue;
      const change = value & 1 ? -(value >>> 1) : value >>> 1;
      mm.push(change + (mm[mm.length - 3 * joints] ?? 0));
      [value, shift] = [0, 0];
    }
    return mm;
  };

  const length = (mm) => mm.length / (3 * joints);
  const frames = () => Math.max(...bodies.map(({ mm }) => length(mm)));
  const at = (mm, frame, joint) => mm.slice(3 * (frame * joints + joint), 3 * (frame * joints + joint) + 3);

  /** The lowest and the highest place of a body along x and z. */
  const extent = (mm) => [0, 2].map((axis) => {
    const all = mm.filter((_, i) => i % 3 === axis);
    return all.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [all[0], all[0]]);
  });
  /** The bodies of the chosen caption, each over the middle of its own floor; all have one scale. */
  const unpack = () => {
    bodies = shown.bodies.map(({ name, mm }) => ({ name, mm: unpacked(mm) }));
    const extents = bodies.map(({ mm }) => extent(mm));
    bodies.forEach((body, i) => { body.centre = extents[i].map(([low, high]) => (low + high) / 2); });
    size = Math.max(2200, ...extents.flat().map(([low, high]) => high - low + 600));
  };

  /** Fits the canvas to the page: a narrow one has two bodies in a row. A cell has its name, a body and its floor. */
  const fit = () => {
    const width = stage.clientWidth || 760;
    const columns = Math.min(bodies.length, width < 560 ? 2 : 4);
    const [wide, name, tall] = [width / columns, 26, 1900 + 0.43 * size];
    const scale = Math.min(0.92 * wide / size, (420 - name) / tall);
    const cell = { columns, wide, scale, high: name + tall * scale };
    const height = cell.high * Math.ceil(bodies.length / columns);
    const ratio = window.devicePixelRatio || 1;
    if (stage.width !== Math.round(width * ratio) || stage.height !== Math.round(height * ratio)) {
      [stage.width, stage.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    }
    const pen = stage.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return [pen, cell];
  };

  /** Pixels of a place from the middle of a cell's upper edge, seen from a little above. */
  const project = ([x, y, z], [x0, z0], { scale, high }) => {
    const [east, north] = [x - x0, z - z0];
    const right = east * Math.cos(turn) + north * Math.sin(turn);
    const away = -east * Math.sin(turn) + north * Math.cos(turn);
    return [right * scale, high - (0.22 * size + 0.95 * y - 0.3 * away) * scale];
  };

  const line = (pen, from, to) => {
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
  };

  const drawFloor = (pen, [x0, z0], cell) => {
    // Squares of half a metre, or twice, four times … as much where the path is long.
    const side = 500 * 2 ** Math.max(0, Math.ceil(Math.log2(size / 20000)));
    const half = Math.round((cell.columns > 1 ? 0.36 : 0.5) * size / side) * side;
    const on = (x, z) => project([x0 + x, 0, z0 + z], [x0, z0], cell);
    pen.lineWidth = 1;
    for (let way = -half; way <= half; way += side) {
      line(pen, on(way, -half), on(way, half));
      line(pen, on(-half, way), on(half, way));
    }
  };
  const drawBody = (pen, { mm, centre }, now, cell) => {
    const then = Math.min(now, length(mm) - 1);
    pen.lineWidth = 3;
    parents.forEach((parent, joint) => {
      if (parent === null) return;
      line(pen, ...[parent, joint].map((end) => project(at(mm, then, end), centre, cell)));
    });
  };

  const draw = () => {
    const [pen, cell] = fit();
    const { color, borderTopColor } = getComputedStyle(stage);
    const now = Number(scrub.value);
    pen.lineCap = "round";
    pen.font = "15px sans-serif";
    pen.textAlign = "center";
    pen.fillStyle = color;
    bodies.forEach((body, i) => {
      pen.save();
      pen.translate((i % cell.columns + 0.5) * cell.wide, Math.floor(i / cell.columns) * cell.high);
      pen.strokeStyle = borderTopColor;
      drawFloor(pen, body.centre, cell);
      pen.strokeStyle = color;
      drawBody(pen, body, now, cell);
      if (bodies.length > 1) pen.fillText(body.name, 0, 22);
      pen.restore();
    });
    scrub.setAttribute("aria-valuetext", `${(now / shown.fps).toFixed(2)} s`);
  };

  const step = (time) => {
    if (!playing) return;
    if (time - began >= 1000 / shown.fps) {
      began = Math.max(began + 1000 / shown.fps, time - 100);
      scrub.value = (Number(scrub.value) + 1) % frames();
      draw();
    }
    requestAnimationFrame(step);
  };
  const start = (on) => {
    playing = on;
    play.textContent = on ? "Pause" : "Play";
    if (on) requestAnimationFrame(step);
  };
  const choose = () => {
    shown = samples[Number(chooser.value)];
    unpack();
    scrub.max = frames() - 1;
    scrub.value = 0;
    maker.textContent = shown.run;
    source.textContent = shown.source ? `; true motion: ${shown.source}` : "";
    draw();
  };

  chooser.addEventListener("change", choose);
  play.addEventListener("click", () => start(!playing));
  scrub.addEventListener("input", () => { start(false); draw(); });
  addEventListener("resize", draw);
  stage.addEventListener("pointermove", ({ buttons, movementX }) => {
    if (buttons) { turn += movementX / 150; draw(); }
  });
  stage.addEventListener("keydown", ({ key }) => {
    const way = { ArrowLeft: -0.15, ArrowRight: 0.15 }[key];
    if (way) { turn += way; draw(); }
  });
  choose();
  start(playing);
}
