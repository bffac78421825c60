// Light and dark theme: the system's preference until the user chooses one.

function themeButton() {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const button = make("button", { type: "button", class: "flat theme", onclick: () => set(now() === "dark" ? "light" : "dark") });
  const now = () => document.documentElement.dataset.theme ?? (dark.matches ? "dark" : "light");
  const set = (theme) => {
    if (theme) document.documentElement.dataset.theme = theme;
    button.textContent = now() === "dark" ? "☀ Light" : "☾ Dark";
    document.dispatchEvent(new Event("theme"));
  };
  dark.addEventListener("change", () => set());
  set();
  return button;
}
