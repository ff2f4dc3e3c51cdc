// Shows the claims that hold all words of the search, with a status that is ticked; without it all are shown.
"use strict";
const form = document.querySelector("form.filter");
const [words, count] = ["input[type=search]", "output"].map((name) => form.querySelector(name));
const ticks = [...form.querySelectorAll("input[type=checkbox]")];
const rows = [...document.querySelectorAll("tr[data-status]")];
const textOf = new Map(rows.map((row) => [row, row.textContent.toLowerCase()]));

function show() {
  const wanted = words.value.toLowerCase().split(/\s+/);
  const statuses = new Set(ticks.filter((tick) => tick.checked).map((tick) => tick.value));
  for (const row of rows) {
    row.hidden = !statuses.has(row.dataset.status) || !wanted.every((word) => textOf.get(row).includes(word));
  }
  for (const part of document.querySelectorAll("section, tbody")) {
    const inside = [...part.querySelectorAll("tr[data-status]")];
    part.hidden = inside.length > 0 && inside.every((row) => row.hidden);
  }
  const shown = rows.filter((row) => !row.hidden).length;
  count.textContent = shown < rows.length ? `${shown} of ${rows.length} claims` : `all ${rows.length} claims`;
}

// a link to a claim must find it
function showTarget() {
  const row = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!row?.closest("[hidden]")) return;
  form.reset();
  show();
  row.scrollIntoView();
}

form.hidden = false;
form.addEventListener("input", show);
form.addEventListener("submit", (event) => event.preventDefault());
addEventListener("hashchange", showTarget);
show();
showTarget();
