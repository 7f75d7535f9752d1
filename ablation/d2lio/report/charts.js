// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
// What all pages share: the look of a figure in either colour scheme, and drawing it when it is seen.
"use strict";
const Charts = (function () {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  function layoutOf(layout) {
    const fg = dark.matches ? "#e6e6e6" : "#1d1f21", line = dark.matches ? "#3a3f44" : "#e3e5e8";
    const own = structuredClone(layout);
    const narrow = innerWidth < 700;
    const themed = Object.assign({
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", autosize: true,
      font: { color: fg, size: narrow ? 11 : 12 },
      margin: { l: 55, r: 12, t: 38, b: own.showlegend ? 105 : 55 },
      legend: { orientation: "h", y: -0.34, traceorder: "normal", font: { size: narrow ? 9 : 10.5 } },
      dragmode: narrow ? false : "zoom",
    }, own);
    themed.title = Object.assign({ x: 0.02, font: { size: 14 } }, themed.title);
    const axes = own.scene || (themed.xaxis = themed.xaxis || {}, themed.yaxis = themed.yaxis || {}, themed);
    for (const axis of own.scene ? ["xaxis", "yaxis", "zaxis"] : ["xaxis", "yaxis"]) {
      axes[axis] = Object.assign({ gridcolor: line, zerolinecolor: line }, axes[axis]);
    }
    return themed;
  }
  function draw(box, figure) {
    Plotly.react(box, figure.data, layoutOf(figure.layout), { responsive: true, displayModeBar: false });
    box.drawn = true;
  }
  // Figures are drawn when they come into view: a phone need not draw them all at once.
  const watcher = new IntersectionObserver(function (entries) {
    for (const entry of entries) {
      entry.target.inView = entry.isIntersecting;
      if (entry.isIntersecting && !entry.target.drawn) { entry.target.make(); }
    }
  }, { rootMargin: "400px" });
  function watch(box, make) {
    box.make = make;
    watcher.observe(box);
  }
  // Anew what is in view; the rest when it comes into view again.
  function redraw() {
    document.querySelectorAll(".plot").forEach(function (box) {
      box.drawn = false;
      if (box.inView) { box.make(); }
    });
  }
  dark.addEventListener("change", redraw);
  return { draw, watch, redraw };
})();
