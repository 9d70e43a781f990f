// Equations arrive as \( ... \) and \[ ... \] in elements of class "arithmatex" (pymdownx.arithmatex, generic).
document.addEventListener("DOMContentLoaded", () => {
  for (const element of document.querySelectorAll(".arithmatex")) {
    const text = element.textContent.trim();
    const tex = text.replace(/^\\[[(]|\\[\])]$/g, "");
    katex.render(tex, element, { displayMode: text.startsWith("\\["), throwOnError: false });
  }
});
