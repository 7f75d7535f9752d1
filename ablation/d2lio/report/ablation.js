// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
// Figures and lists of an ablation's page, made from the embedded data when they are first seen.
"use strict";
(function () {
  const byId = (id) => document.getElementById(id);
  const meta = JSON.parse(byId("meta").textContent);
  const shown = new Set(meta.variants.map((v, i) => i).filter((i) => meta.variants[i].shown));
  const parsed = new Map(); // sequence → its curves
  const chosen = { sequence: 0, repeat: 0, align: "whole" };

  function curves() {
    if (!parsed.has(chosen.sequence)) {
      parsed.set(chosen.sequence, JSON.parse(byId("sequence-" + chosen.sequence).textContent));
    }
    return parsed.get(chosen.sequence);
  }
  const current = () => curves().repeats[chosen.repeat] || { runs: {} };
  // A packed curve: see pack() in embed.py.
  function decode(packed) {
    if (!packed) { return []; }
    const bytes = Uint8Array.from(atob(packed.d), (c) => c.charCodeAt(0)), values = [];
    for (let i = 0; i < bytes.length; i += 2) {
      const code = bytes[i] + 256 * bytes[i + 1], value = packed.o + packed.s * code;
      values.push(code === 65535 ? null : packed.l ? Math.pow(10, value) : value);
    }
    return values;
  }
  const span = (values) => [Math.min(...values), Math.max(...values)];
  function roomy(values) { // a range with a margin, for a lost run not to spoil it
    const [low, high] = span(values), margin = Math.max(0.15 * (high - low), 1);
    return [low - margin, high + margin];
  }

  // Ticks of a logarithmic axis: 1, 2 and 5 of each decade where they are few, else decades.
  function logAxis(title, values, more) {
    const known = values.filter((v) => v > 0), axis = Object.assign({ title: title, type: "log" }, more);
    const [low, high] = known.length ? span(known).map(Math.log10) : [0, 1], ticks = [];
    for (let k = Math.floor(low); k <= Math.ceil(high); k += 1) {
      for (const digit of high - low < 3 ? [1, 2, 5] : [1]) { ticks.push(Number((digit + "e" + k))); }
    }
    return Object.assign(axis, { tickmode: "array", tickvals: ticks, ticktext: ticks.map((v) =>
      (v >= 1e4 || v < 1e-3 ? v.toExponential(0).replace("e+", "e") : String(v))) });
  }

  function line(variant, x, y, more) {
    const v = meta.variants[variant];
    return Object.assign({
      type: "scatter", mode: "lines", name: v.title, x: x, y: y, line: { width: 1.7, color: v.colour, dash: v.dash },
    }, more);
  }
  function runs() {
    const now = current().runs;
    return Object.keys(now).map(Number).filter((i) => shown.has(i)).map((i) => [i, now[i]]);
  }
  const plain = (title, x, y, more) => Object.assign({
    title: { text: title }, showlegend: false, hovermode: "closest",
    xaxis: { title: { text: x, standoff: 6 } }, yaxis: { title: { text: y } },
  }, more);

  // The path of a run, aligned as chosen: run.m (3x4, by rows) leads from the one to the other.
  function path(run) {
    const [x, y, z] = [decode(run.x), decode(run.y), decode(run.z)];
    if (chosen.align === "whole" || !run.m) { return { x: x, y: y, z: z }; }
    const row = (k) => x.map((value, i) => run.m[k] * value + run.m[k + 1] * y[i] + run.m[k + 2] * z[i] + run.m[k + 3]);
    return { x: row(0), y: row(4), z: row(8) };
  }

  function view(title, axis) {
    const truth = current().truth || {}, x = decode(truth.x), y = decode(truth[axis]);
    const data = [{ type: "scatter", mode: "lines", name: "truth", x: x, y: y, line: { width: 5, color: meta.truth } }];
    for (const [i, run] of runs()) {
      const moved = path(run);
      data.push(line(i, moved.x, moved[axis]));
    }
    const layout = plain(title, "x [m]", axis + " [m]");
    if (x.length) {
      layout.xaxis.range = roomy(x);
      layout.yaxis.range = roomy(y);
    }
    if (axis === "y") { layout.yaxis.scaleanchor = "x"; }
    return { data: data, layout: layout };
  }
  function overTime(title, y, time, key) {
    const layout = plain(title, "time [s]", y);
    const data = runs().filter(([, run]) => run[key]).map(([i, run]) => line(i, decode(run[time]), decode(run[key])));
    layout.yaxis = logAxis(layout.yaxis.title, data.flatMap((trace) => trace.y));
    return { data: data, layout: layout };
  }
  function bars(title, x, data, colours) {
    data.forEach(function (bar, i) {
      Object.assign(bar, { type: "bar", orientation: "h", marker: { color: colours[i % colours.length] } });
    });
    return { data: data, layout: plain(title, x, "", {
      barmode: "stack", showlegend: true, legend: LEGEND, yaxis: { autorange: "reversed", automargin: true, type: "category" } }) };
  }

  const LEGEND = { orientation: "h", yref: "container", y: 0, yanchor: "bottom", traceorder: "normal", font: { size: 10.5 } };

  const figures = {
    top: () => view("Top view", "y"),
    side: () => view("Side view", "z"),
    error: () => overTime("Translation error, aligned as a whole", "error [m]", "t", "e"),
    lambda_t: () => overTime("λ_min, translation block", "λ_min [points]", "s", "lt"),
    lambda_r: () => overTime("λ_min, rotation block", "λ_min [points·m²]", "s", "lr"),
    outcomes: function () {
      const kept = runs().filter(([, run]) => run.o), names = kept.map(([i]) => meta.variants[i].title);
      const data = meta.outcomes.map((label, k) => ({ name: label, y: names, x: kept.map(([, run]) => 100 * (run.o[k] || 0)) }));
      return bars("Correspondences by outcome", "share [%]", data, meta.outcome_colours);
    },
    ranges: function () {
      const data = runs().filter(([, run]) => run.b).map(([i, run]) =>
        Object.assign(line(i, meta.ranges, run.b.map((v) => (v === null ? null : 100 * v))), { mode: "lines+markers" }));
      return { data: data, layout: plain("Rejected, by the point's distance", "", "rejected [%]", {
        xaxis: { type: "category", categoryarray: meta.ranges, automargin: true } }) };
    },
    stages: function () {
      const kept = meta.timing.map((t, i) => [i, t]).filter(([i, t]) => shown.has(i) && t.stages);
      const names = kept.map(([i]) => meta.variants[i].title);
      const data = meta.stages.map((stage, k) => ({ name: stage, y: names, x: kept.map(([, t]) => t.stages[k]) }));
      return bars("Time per scan by stage", "mean over the runs [ms]", data, meta.stage_colours);
    },
    per_scan: function () {
      const data = [];
      meta.timing.forEach(function (t, i) {
        if (!shown.has(i) || !t.box.length) { return; }
        const v = meta.variants[i];
        data.push({ type: "box", name: v.title, x: t.box, y: t.box.map(() => v.title), orientation: "h", boxpoints: "outliers",
          line: { color: v.colour }, marker: { color: v.colour, size: 3 } });
      });
      return { data: data, layout: plain("Time per scan", "median of a run [ms]", "", {
        xaxis: logAxis({ text: "median of a run [ms]", standoff: 6 }, data.flatMap((trace) => trace.x)),
        yaxis: { autorange: "reversed", automargin: true, type: "category" } }) };
    },
    differences: function () {
      const kinds = [...shown].sort((a, b) => a - b), data = [];
      for (const i of kinds) {
        const own = meta.differences.filter((d) => d[1] === i);
        if (!own.length) { continue; }
        const x = own.map((d) => d[2]), bound = (k, sign) => own.map((d) => (d[k] === null ? 0 : sign * (d[k] - d[2])));
        data.push({ type: "scatter", mode: "markers", name: meta.variants[i].title, x: x, y: own.map((d) => meta.sequences[d[0]].name),
          error_x: { type: "data", symmetric: false, array: bound(4, 1), arrayminus: bound(3, -1), thickness: 1.4, width: 3 },
          marker: { color: meta.variants[i].colour, size: 8, symbol: i % 5 } });
      }
      const layout = plain("Ratio to " + meta.baseline, "ATE / ATE of " + meta.baseline + ", with 95 % interval", "", {
        scattermode: "group", showlegend: true, legend: LEGEND,
        shapes: [{ type: "line", x0: 1, x1: 1, y0: 0, y1: 1, yref: "paper", line: { width: 1, color: meta.truth } }] });
      const all = meta.differences.filter((d) => shown.has(d[1])).flatMap((d) => d.slice(2).filter((v) => v !== null));
      layout.xaxis = logAxis(layout.xaxis.title, all.concat(0.5, 2));
      layout.yaxis = { autorange: "reversed", automargin: true, type: "category" };
      return { data: data, layout: layout };
    },
    space: function () {
      const map = curves().map || {}, truth = current().truth || {}, data = [];
      const trace3 = (points, style, name) => Object.assign({ type: "scatter3d", mode: "lines", name: name, line: style }, points);
      if (map.x && chosen.repeat === meta.sequences[chosen.sequence].repeats[0]) {
        const z = decode(map.z), sorted = z.slice().sort((a, b) => a - b), at = (share) => sorted[Math.floor(share * (sorted.length - 1))];
        data.push({ type: "scatter3d", mode: "markers", name: "map", hoverinfo: "skip", x: decode(map.x), y: decode(map.y), z: z,
          marker: { size: 1.3, color: z, cmin: at(0.02), cmax: at(0.98), colorscale: "Viridis", opacity: 0.6 } });
      }
      data.push(trace3(path(truth), { color: meta.truth, width: 7 }, "truth"));
      const most = (values) => { // without the few points far away
        const sorted = values.slice().sort((a, b) => a - b), cut = Math.floor(sorted.length / 50);
        return sorted.slice(cut, sorted.length - cut);
      };
      const all = ["x", "y", "z"].map((k) => decode(truth[k]).concat(most(decode(map[k]))));
      const ranges = all.map((values) => (values.length ? roomy(values) : [-1, 1]));
      for (const [i, run] of runs()) {
        const trace = trace3(path(run), { color: meta.variants[i].colour, width: 4 }, meta.variants[i].title);
        // A lost path would shrink everything else: it ends at the frame.
        ["x", "y", "z"].forEach(function (axis, k) {
          trace[axis] = trace[axis].map((value) => (value < ranges[k][0] || value > ranges[k][1] ? null : value));
        });
        data.push(trace);
      }
      const sizes = ranges.map(([low, high]) => high - low), largest = Math.max(...sizes);
      const ratio = { x: 1.9 * sizes[0] / largest, y: 1.9 * sizes[1] / largest, z: 1.9 * sizes[2] / largest };
      const eye = ratio.x > ratio.y ? { x: -0.35, y: -1.25, z: 0.75 } : { x: -1.25, y: -0.35, z: 0.75 }; // across the longer side
      const axis = (name, k) => ({ title: { text: name + " [m]" }, range: ranges[k], nticks: name === "z" ? 4 : 8, backgroundcolor: "rgba(0,0,0,0)" });
      return { data: data, layout: { title: { text: "" }, showlegend: false, margin: { l: 0, r: 0, t: 0, b: 0 }, dragmode: "orbit",
        uirevision: "space", scene: { aspectmode: "manual", aspectratio: ratio, camera: { eye: eye }, xaxis: axis("x", 0), yaxis: axis("y", 1), zaxis: axis("z", 2) } } };
    },
  };

  function element(tag, text, more) {
    const made = Object.assign(document.createElement(tag), more || {});
    if (text !== undefined) { made.textContent = text; }
    return made;
  }
  function link(run, file) {
    return element("a", file, { href: encodeURI(run.directory + "/" + file).replaceAll("#", "%23") });
  }
  function listing(heads, rows) {
    const table = element("table", undefined, { className: "left" });
    const head = table.createTHead().insertRow();
    heads.forEach((text) => head.append(element("th", text)));
    const body = table.createTBody();
    for (const cells of rows) {
      const row = body.insertRow();
      for (const content of cells) {
        const cell = row.insertCell();
        cell.append(...[content].flat());
      }
    }
    return table;
  }
  const filesOf = (run) => run.files.flatMap((k, n) => (n ? [" ", link(run, meta.files[k])] : [link(run, meta.files[k])]));
  const ate = (run) => (run.ate === null ? "" : run.ate < 10 ? run.ate.toFixed(3) : run.ate.toFixed(1));
  const lists = {
    failures: function () {
      const failed = meta.runs.filter((r) => r.reason !== "");
      if (!failed.length) { return element("p", "No run failed."); }
      return listing(["sequence", "repeat", "variant", "reason", "ATE [m]", "files"], failed.map((r) =>
        [meta.sequences[r.sequence].name, String(r.repeat), meta.variants[r.variant].title, r.reason, ate(r), filesOf(r)]));
    },
    files: () => listing(["variant", "ATE [m]", "files"],
      meta.runs.filter((r) => r.sequence === chosen.sequence && r.repeat === chosen.repeat).map((r) =>
        [meta.variants[r.variant].title, r.reason ? "failed" : ate(r), filesOf(r)])),
  };
  function fillLists() {
    for (const box of document.querySelectorAll("[data-list]")) {
      if (box.closest("details").open) { box.replaceChildren(lists[box.dataset.list]()); }
    }
  }

  function refresh() {
    const there = new Set(meta.runs.filter((r) => r.sequence === chosen.sequence).map((r) => r.variant));
    chips.forEach((button, i) => { button.hidden = !there.has(i); });
    Charts.redraw();
    fillLists();
  }
  function setRepeats() {
    const repeats = meta.sequences[chosen.sequence].repeats;
    if (!repeats.includes(chosen.repeat)) { chosen.repeat = repeats[0]; }
    byId("repeat").replaceChildren(...repeats.map((r) => new Option("repeat " + r, r, false, r === chosen.repeat)));
  }
  for (const dataset of new Set(meta.sequences.map((s) => s.dataset))) {
    const group = dataset ? element("optgroup", undefined, { label: dataset }) : byId("sequence");
    meta.sequences.forEach((s, i) => { if (s.dataset === dataset) { group.append(new Option(s.name, i)); } });
    if (dataset) { byId("sequence").append(group); }
  }
  byId("sequence").addEventListener("change", function (event) {
    chosen.sequence = Number(event.target.value);
    setRepeats();
    refresh();
  });
  byId("align").addEventListener("change", function (event) {
    chosen.align = event.target.value;
    Charts.redraw();
  });
  byId("repeat").addEventListener("change", function (event) {
    chosen.repeat = Number(event.target.value);
    refresh();
  });

  const chips = meta.variants.map(function (v, i) {
    const button = element("button"), mark = element("i");
    button.setAttribute("aria-pressed", shown.has(i));
    mark.style.borderTopColor = v.colour;
    mark.style.borderTopStyle = v.dash === "solid" ? "solid" : v.dash === "dot" ? "dotted" : "dashed";
    button.append(mark, v.title);
    button.addEventListener("click", function () {
      if (shown.has(i)) { shown.delete(i); } else { shown.add(i); }
      button.setAttribute("aria-pressed", shown.has(i));
      Charts.redraw();
    });
    byId("chips").append(button);
    return button;
  });

  for (const box of document.querySelectorAll(".plot[data-figure]")) {
    Charts.watch(box, () => Charts.draw(box, figures[box.dataset.figure]()));
  }
  document.querySelectorAll("details.section").forEach((d) => d.addEventListener("toggle", fillLists));
  setRepeats();
  refresh();
})();
