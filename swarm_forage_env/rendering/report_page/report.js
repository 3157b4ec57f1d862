const keyOf = (row, column) => {
  const cell = row.cells[column];
  if (!cell) return "";
  return cell.dataset.value === undefined ? cell.textContent.trim() : Number(cell.dataset.value);
};
const compare = (a, b) =>
  typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
const sort = (table, heading) => {
  const isUp = heading.getAttribute("aria-sort") !== "ascending";
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", isUp ? "ascending" : "descending");
  // Of claims, each with its numbers below it, the groups of rows are sorted; else the rows.
  const isGrouped = table.classList.contains("claimed");
  const parts = isGrouped ? [...table.tBodies] : [...table.tBodies[0].rows];
  const key = (part) => keyOf(isGrouped ? part.rows[0] : part, heading.cellIndex);
  parts.sort((a, b) => (isUp ? 1 : -1) * compare(key(a), key(b)));
  (isGrouped ? table : table.tBodies[0]).append(...parts);
};
for (const table of document.querySelectorAll("table.sortable")) {
  for (const heading of table.tHead.rows[0].cells) {
    const button = document.createElement("button");
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => sort(table, heading));
  }
}
// On paper nothing can be unfolded.
let folded = [];
addEventListener("beforeprint", () => {
  folded = [...document.querySelectorAll("details:not([open])")];
  for (const one of folded) one.open = true;
});
addEventListener("afterprint", () => {
  for (const one of folded) one.open = false;
});
