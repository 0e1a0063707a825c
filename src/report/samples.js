"use strict";
// A skeleton on a canvas. Positions are millimetres; y points up.
{
  const { parents, samples } = JSON.parse(document.getElementById("motions").textContent);
  const [chooser, stage, play, scrub, maker] =
    ["sample", "stage", "play", "frame", "maker"].map((id) => document.getElementById(id));
  const joints = parents.length;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let [shown, centre, size, turn, playing, began] = [samples[0], [0, 0], 1, 0.6, !still, 0];

  const length = (mm) => mm.length / (3 * joints);
  const frames = () => Math.max(...shown.bodies.map(({ mm }) => length(mm)));
  const at = (mm, frame, joint) => mm.slice(3 * (frame * joints + joint), 3 * (frame * joints + joint) + 3);
  /** Motions, their labels, and their offset to the right in widths of the stage. */
  const bodies = () => {
    const n = shown.bodies.length;
    return shown.bodies.map(({ mm, name }, i) => [mm, n > 1 ? name : "", (i - (n - 1) / 2) * 0.96 / n]);
  };

  /** The middle of the floor, and the extent that has to fit. */
  const frame = () => {
    const sides = [0, 2].map((axis) => {
      const all = bodies().flatMap(([mm]) => mm.filter((_, i) => i % 3 === axis));
      return all.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [all[0], all[0]]);
    });
    centre = sides.map(([low, high]) => (low + high) / 2);
    size = Math.max(2200, ...sides.map(([low, high]) => high - low + 600));
  };

  /** Pixels of a place, seen from a little above. */
  const project = ([x, y, z], aside) => {
    const [east, north] = [x - centre[0], z - centre[1]];
    const right = east * Math.cos(turn) + north * Math.sin(turn);
    const away = -east * Math.sin(turn) + north * Math.cos(turn);
    const scale = stage.height * Math.min(0.8, 1.6 / shown.bodies.length) / size;
    return [stage.width * (0.5 + aside) + right * scale, stage.height * 0.86 - (0.95 * y - 0.3 * away) * scale];
  };

  const line = (pen, from, to) => {
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
  };

  const draw = () => {
    const pen = stage.getContext("2d");
    const { color, borderTopColor } = getComputedStyle(stage);
    pen.clearRect(0, 0, stage.width, stage.height);
    pen.lineWidth = 1;
    pen.strokeStyle = borderTopColor;
    // Squares of half a metre, or twice, four times … as much where the path is long.
    const side = 500 * 2 ** Math.max(0, Math.ceil(Math.log2(size / 20000)));
    const half = Math.ceil(size / (2 * side)) * side / Math.min(2, shown.bodies.length);
    for (const [, , aside] of bodies()) {
      for (let way = -half; way <= half; way += side) {
        const [x, z] = [centre[0] + way, centre[1] + way];
        line(pen, project([x, 0, centre[1] - half], aside), project([x, 0, centre[1] + half], aside));
        line(pen, project([centre[0] - half, 0, z], aside), project([centre[0] + half, 0, z], aside));
      }
    }
    pen.lineWidth = 4;
    pen.lineCap = "round";
    pen.strokeStyle = pen.fillStyle = color;
    pen.font = "15px sans-serif";
    pen.textAlign = "center";
    const now = Number(scrub.value);
    for (const [mm, name, aside] of bodies()) {
      const then = Math.min(now, length(mm) - 1);
      parents.forEach((parent, joint) => {
        if (parent !== null) line(pen, project(at(mm, then, parent), aside), project(at(mm, then, joint), aside));
      });
      pen.fillText(name, stage.width * (0.5 + aside), 24);
    }
    scrub.setAttribute("aria-valuetext", `${(now / shown.fps).toFixed(2)} s`);
  };

  const step = (time) => {
    if (!playing) return;
    if (time - began >= 1000 / shown.fps) {
      began = time;
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
    scrub.max = frames() - 1;
    scrub.value = 0;
    maker.textContent = shown.run;
    frame();
    draw();
  };

  chooser.addEventListener("change", choose);
  play.addEventListener("click", () => start(!playing));
  scrub.addEventListener("input", () => { start(false); draw(); });
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
