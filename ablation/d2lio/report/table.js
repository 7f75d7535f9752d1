// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
// Tables: sorting by column, filters, what lies behind a cell.
"use strict";
(function () {
  const byId = (id) => document.getElementById(id);
  const tables = [...document.querySelectorAll("table.results")];

  // A column sorts upwards, then downwards, then as the suite has it.
  const NEXT = { none: "ascending", ascending: "descending", descending: "none" };
  const number = (text) => (text === undefined || text === "" ? Infinity : Number(text));
  function sorter(head, order) {
    const index = head.cellIndex, sign = order === "descending" ? -1 : 1;
    if (index === 0) { return (a, b) => sign * a.cells[0].textContent.localeCompare(b.cells[0].textContent); }
    return function (a, b) {
      const x = number(a.cells[index].dataset.value), y = number(b.cells[index].dataset.value);
      if (x === y) { return a.dataset.order - b.dataset.order; }
      return !isFinite(x) ? 1 : !isFinite(y) ? -1 : sign * (x - y); // what has no number stays last
    };
  }
  function sort(table, head) {
    const order = NEXT[head.getAttribute("aria-sort")];
    for (const other of table.tHead.querySelectorAll("th[aria-sort]")) { other.setAttribute("aria-sort", "none"); }
    head.setAttribute("aria-sort", order);
    table.dataset.sorted = order === "none" ? "" : "yes";
    const body = table.tBodies[0], rows = [...body.rows], last = rows.filter((r) => r.dataset.last);
    const movable = rows.filter((r) => !r.dataset.last);
    movable.sort((a, b) => a.dataset.order - b.dataset.order);
    if (order !== "none") {
      const data = movable.filter((r) => !r.classList.contains("group"));
      movable.splice(0, movable.length, ...movable.filter((r) => r.classList.contains("group")), ...data.sort(sorter(head, order)));
    }
    body.append(...movable, ...last);
    filter();
  }

  // The text names rows, or columns where no row has it; the lists name data sets and hosts,
  // whichever of rows and columns they are.
  function filter() {
    const text = byId("filter").value.trim().toLowerCase();
    const chosen = { sequence: byId("dataset").value, variant: byId("host").value };
    let any = false;
    for (const table of tables) {
      const head = [...table.tHead.rows[0].cells].slice(1);
      const rows = [...table.tBodies[0].rows], data = rows.filter((r) => !r.classList.contains("group"));
      const has = (e) => (e.dataset.name + " " + e.dataset.group).toLowerCase().includes(text);
      const inGroup = (e) => !chosen[e.dataset.kind] || e.dataset.group === chosen[e.dataset.kind];
      const named = data.filter((r) => !r.dataset.last && has(r)), byColumn = named.length === 0 && head.some(has);
      head.forEach(function (cell) {
        const hide = !inGroup(cell) || (byColumn && !has(cell));
        cell.hidden = hide;
        data.forEach(function (row) { row.cells[cell.cellIndex].hidden = hide; });
      });
      for (const row of data) {
        const all = row.dataset.last ? !text || byColumn : byColumn || has(row);
        row.hidden = !(all && inGroup(row));
      }
      for (const row of rows.filter((r) => r.classList.contains("group"))) {
        row.hidden = table.dataset.sorted === "yes" && !row.dataset.last ||
          !data.some((r) => !r.hidden && r.dataset.block === row.dataset.block);
      }
      const seen = data.some((r) => !r.hidden) && head.some((c) => !c.hidden);
      table.closest(".block").hidden = !seen;
      any = any || seen;
    }
    byId("nothing").hidden = any;
  }

  function fillChoice(id, kind, everything) {
    const groups = new Set();
    for (const e of document.querySelectorAll(".results [data-kind='" + kind + "']")) {
      if (e.dataset.group && !e.dataset.last) { groups.add(e.dataset.group); }
    }
    const select = byId(id);
    select.append(new Option(everything, ""), ...[...groups].map((g) => new Option(g, g)));
    select.hidden = groups.size < 2;
    select.addEventListener("change", filter);
  }

  const tip = byId("tip");
  function showTip(cell) {
    tip.textContent = cell.dataset.tip;
    tip.hidden = false;
    const at = cell.getBoundingClientRect(), own = tip.getBoundingClientRect();
    const left = Math.min(Math.max(8, at.left), innerWidth - own.width - 8);
    const below = at.bottom + 6, above = at.top - own.height - 6;
    tip.style.left = Math.max(8, left) + "px";
    tip.style.top = (below + own.height < innerHeight || above < 8 ? below : above) + "px";
  }
  const hideTip = () => { tip.hidden = true; };
  for (const cell of document.querySelectorAll("[data-tip]")) {
    cell.setAttribute("aria-describedby", "tip");
    for (const event of ["pointerenter", "focus", "click"]) { cell.addEventListener(event, () => showTip(cell)); }
    for (const event of ["pointerleave", "blur"]) { cell.addEventListener(event, hideTip); }
  }
  addEventListener("keydown", (event) => { if (event.key === "Escape") { hideTip(); } });
  addEventListener("scroll", hideTip, { passive: true });

  for (const table of tables) {
    for (const head of table.tHead.querySelectorAll("th[aria-sort]")) {
      head.querySelector("button").addEventListener("click", () => sort(table, head));
    }
  }
  byId("filter").addEventListener("input", filter);
  fillChoice("dataset", "sequence", "all data sets");
  fillChoice("host", "variant", "all hosts");
})();
