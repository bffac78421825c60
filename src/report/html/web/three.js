// Loads three.js from the page: two modules, one importing the other by name, unpacked on first use.

let threeLoaded;

function loadThree() {
  threeLoaded ??= (async () => {
    const [core, module] = await Promise.all([unpackText("three-core"), unpackText("three-module")]);
    const address = (text) => URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    return import(address(module.replaceAll('"./three.core.min.js"', JSON.stringify(address(core)))));
  })();
  return threeLoaded;
}
