// Draws the formulas of a page of the site; the signs around each are left away.
document.querySelectorAll(".arithmatex").forEach(each =>
  katex.render(each.textContent.trim().slice(2, -2), each, { displayMode: each.tagName === "DIV" })
);
