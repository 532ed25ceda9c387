"use strict";
// tables: sort by a column, show the rows that hold a text
const value = (text) => {
  const found = text.replace("−", "-").replace(/∞|never/, "1e400").match(/^[<+]?\s*(-?[\d.]+(e-?\d+)?)/);
  return found ? Number(found[1]) : NaN;
};
document.querySelectorAll("table").forEach((table) => {
  const body = table.tBodies[0];
  const rows = [...body.rows];
  if (rows.length < 2) return;
  const titled = rows.some((row) => row.classList.contains("title"));
  if (!titled) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const up = head.ariaSort !== "ascending";
        [...table.tHead.rows[0].cells].forEach((cell) => { cell.ariaSort = null; });
        head.ariaSort = up ? "ascending" : "descending";
        const key = (row) => row.cells[column].textContent.trim();
        const compare = (a, b) => {
          const [x, y] = [value(key(a)), value(key(b))];
          if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
          const order = Number.isNaN(x) ? key(a).localeCompare(key(b), undefined, { numeric: true }) : x - y;
          return up ? order : -order;
        };
        body.append(...[...rows].sort(compare));
      });
    });
  }
  if (rows.length > 8) {
    const filter = document.createElement("input");
    filter.type = "search";
    filter.placeholder = `filter ${rows.length} rows`;
    filter.ariaLabel = "Show the rows that hold this text";
    filter.addEventListener("input", () => {
      const wanted = filter.value.toLowerCase();
      rows.forEach((row) => { row.hidden = !row.textContent.toLowerCase().includes(wanted); });
    });
    table.parentElement.before(filter);
  }
});
document.querySelectorAll("button.copy").forEach((button) => button.addEventListener("click", async () => {
  const code = button.previousElementSibling;
  try {
    await navigator.clipboard.writeText(code.textContent);
    button.textContent = "copied";
  } catch { // no permission in a page that is a file
    getSelection().selectAllChildren(code);
    button.textContent = document.execCommand("copy") ? "copied" : "press Ctrl-C";
  }
  setTimeout(() => { button.textContent = "copy"; }, 2000);
}));
// a link into what is folded opens it
const reveal = () => {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)) || "summary");
  target?.querySelector(":scope > details")?.setAttribute("open", "");
  for (let place = target; place; place = place.parentElement) if (place.tagName === "DETAILS") place.open = true;
};
addEventListener("hashchange", reveal);
reveal();
