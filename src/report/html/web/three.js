// three.js out of the page: two modules that know each other by name, unpacked when first needed.

let threeLoaded;

function loadThree() {
  threeLoaded ??= (async () => {
    const [core, module] = await Promise.all([unpackText("three-core"), unpackText("three-module")]);
    const address = (text) => URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    return import(address(module.replaceAll('"./three.core.min.js"', JSON.stringify(address(core)))));
  })();
  return threeLoaded;
}
