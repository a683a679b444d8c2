// Tables sort by their heads and are filtered by a field above them; without this the page is whole all the same.
for (const table of document.querySelectorAll("main table")) {
  const body = table.tBodies[0], rows = [...body.rows];
  if (rows.length < 3) continue;
  const text = (row, n) => row.cells[n].firstChild?.textContent.trim() ?? "";
  const size = (words) => /^[<+-]?[\d.]/.test(words) ? parseFloat(words.replace(/^[<+]/, "")) : NaN;
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, n) => {
    if (!head.textContent) return;
    const button = document.createElement("button");
    button.type = "button";
    button.append(head.firstChild);
    head.prepend(button);
    button.addEventListener("click", () => {
      const next = { none: "ascending", ascending: "descending", descending: "none" }[head.ariaSort ?? "none"];
      heads.forEach((each) => each.removeAttribute("aria-sort"));
      let order = rows;
      if (next !== "none") {
        head.ariaSort = next;
        const known = rows.filter((row) => !["", "–"].includes(text(row, n)));
        const numbers = known.every((row) => !isNaN(size(text(row, n))));
        const sign = next === "ascending" ? 1 : -1;
        known.sort((a, b) => sign * (numbers ? size(text(a, n)) - size(text(b, n))
          : text(a, n).localeCompare(text(b, n), "en", { numeric: true })));
        order = [...known, ...rows.filter((row) => !known.includes(row))];
      }
      body.append(...order);
    });
  });
  if (rows.length < 10) continue;
  const field = document.createElement("input"), count = document.createElement("output"), line = document.createElement("p");
  Object.assign(field, { type: "search", placeholder: `filter ${rows.length} rows`, ariaLabel: `filter ${rows.length} rows` });
  line.className = "filter";
  line.append(field, " ", count);
  table.parentNode.before(line);
  field.addEventListener("input", () => {
    const wanted = field.value.trim().toLowerCase();
    for (const row of rows) row.hidden = !row.textContent.toLowerCase().includes(wanted);
    count.value = wanted ? `${rows.filter((row) => !row.hidden).length} of ${rows.length} rows` : "";
  });
}
