//! A headless browser, controlled over two pipes (the DevTools protocol), with only Debian's
//! package.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Names of the browser's program.
const NAMES: [&str; 6] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "chromium-headless-shell",
];
/// A slow machine renders in software.
const PATIENCE: Duration = Duration::from_secs(90);
/// The polling interval.
const PAUSE: Duration = Duration::from_millis(30);

/// A browser with one page. Dropping it ends the browser.
pub struct Chromium {
    child: Child,
    input: ChildStdin,
    answers: Receiver<Value>,
    session: Option<String>,
    number: u64,
    /// Errors that the page reported.
    pub complaints: Vec<String>,
    _profile: tempfile::TempDir,
}

/// The browser's program: the one that `ACTCHECK_CHROMIUM` names, or an installed one.
fn program() -> PathBuf {
    if let Some(named) = std::env::var_os("ACTCHECK_CHROMIUM") {
        return named.into();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let file = NAMES
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    file.into_iter().find(|file| file.is_file()).unwrap_or_else(|| {
        panic!("this test needs Chromium: `apt-get install chromium`, or name one in ACTCHECK_CHROMIUM")
    })
}

/// Whether a warning comes from the software renderer, about its own speed in reading back WebGL's
/// pixels.
fn is_of_the_driver(text: &Value) -> bool {
    text.as_str()
        .is_some_and(|text| text.contains("GPU stall due to ReadPixels"))
}

impl Chromium {
    pub fn start() -> Self {
        let profile = tempfile::tempdir().unwrap();
        // The browser reads from file descriptor 3 and writes to 4.
        let mut child = Command::new("sh")
            .args([
                "-c",
                "exec \"$0\" \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null 2>/dev/null",
            ])
            .arg(program())
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-dev-shm-usage",
                "--remote-debugging-pipe",
                "--hide-scrollbars",
            ])
            .args([
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--no-first-run",
                "about:blank",
            ])
            // Plain software rendering of pages is faster than an emulated graphics card, which
            // only WebGL needs.
            .arg("--disable-gpu-compositing")
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let (send, answers) = channel();
        std::thread::spawn(move || {
            for message in BufReader::new(output).split(0).map_while(Result::ok) {
                let Ok(message) = serde_json::from_slice(&message) else {
                    break;
                };
                if send.send(message).is_err() {
                    break;
                }
            }
        });
        let mut browser = Self {
            child,
            input,
            answers,
            session: None,
            number: 0,
            complaints: Vec::new(),
            _profile: profile,
        };
        let target =
            browser.call("Target.createTarget", json!({ "url": "about:blank" }))["targetId"]
                .clone();
        let attached = browser.call(
            "Target.attachToTarget",
            json!({ "targetId": target, "flatten": true }),
        );
        browser.session = Some(attached["sessionId"].as_str().unwrap().to_owned());
        for domain in ["Page", "Runtime", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser
    }

    /// Sends a command to the browser.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.asked(method, params)
            .unwrap_or_else(|fault| panic!("{method}: {fault}"))
    }

    fn asked(&mut self, method: &str, params: Value) -> Result<Value, String> {
        self.number += 1;
        let mut message = json!({ "id": self.number, "method": method, "params": params });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.input
            .write_all(format!("{message}\0").as_bytes())
            .unwrap();
        self.input.flush().unwrap();
        loop {
            let answer = self
                .answers
                .recv_timeout(PATIENCE)
                .unwrap_or_else(|_| panic!("no answer to {method}"));
            if answer["id"] == json!(self.number) {
                let fault = &answer["error"];
                return if fault.is_null() {
                    Ok(answer["result"].clone())
                } else {
                    Err(fault.to_string())
                };
            }
            self.listen(&answer);
        }
    }

    fn listen(&mut self, event: &Value) {
        let bad = |word: &Value| {
            ["error", "warning", "assert"].contains(&word.as_str().unwrap_or_default())
        };
        let params = &event["params"];
        let complaint = match event["method"].as_str().unwrap_or_default() {
            "Runtime.exceptionThrown" => true,
            "Runtime.consoleAPICalled" => bad(&params["type"]),
            "Log.entryAdded" => {
                bad(&params["entry"]["level"]) && !is_of_the_driver(&params["entry"]["text"])
            }
            _ => false,
        };
        if complaint {
            self.complaints.push(params.to_string());
        }
    }

    /// The value of an expression in the page, which may be a promise.
    pub fn value(&mut self, expression: &str) -> Value {
        self.evaluated(expression)
            .unwrap_or_else(|fault| panic!("{expression}: {fault}"))
    }

    fn evaluated(&mut self, expression: &str) -> Result<Value, String> {
        let asked =
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let answer = self.asked("Runtime.evaluate", asked)?;
        if answer["exceptionDetails"].is_null() {
            Ok(answer["result"]["value"].clone())
        } else {
            Err(answer["exceptionDetails"].to_string())
        }
    }

    /// Waits until an expression is true. While a page is loading, it counts as false.
    pub fn until(&mut self, expression: &str) {
        let start = Instant::now();
        loop {
            let found = self.evaluated(&format!("Boolean({expression})"));
            if found == Ok(json!(true)) {
                return;
            }
            if start.elapsed() >= PATIENCE {
                let page = self.evaluated("`${location.href}\n${document.body?.innerText}`");
                panic!(
                    "{expression} never became true: {found:?}, {:?}\n{page:?}",
                    self.complaints
                );
            }
            std::thread::sleep(PAUSE);
        }
    }

    /// Opens an address.
    pub fn visit(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": "about:blank" }));
        self.call("Page.navigate", json!({ "url": url }));
    }

    /// Opens a report at a view, such as `/runs`.
    pub fn open(&mut self, file: &Path, view: &str) {
        self.visit(&format!("file://{}#{view}", file.display()));
        self.until("document.documentElement.dataset.ready");
    }

    /// Sets the size of the page. Unit: pixels.
    pub fn size(&mut self, width: u32, height: u32) {
        let asked = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        self.call("Emulation.setDeviceMetricsOverride", asked);
    }

    /// Sets the system's preferred theme: `light` or `dark`.
    pub fn theme(&mut self, theme: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": theme }]);
        self.call(
            "Emulation.setEmulatedMedia",
            json!({ "features": features }),
        );
    }

    /// Presses a key such as `ArrowDown`.
    pub fn press(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            self.call(
                "Input.dispatchKeyEvent",
                json!({ "type": kind, "key": key, "code": key }),
            );
        }
    }

    /// A screenshot of the visible part, as PNG.
    pub fn picture(&mut self) -> Vec<u8> {
        use base64::Engine as _;
        let began = Instant::now();
        let letters = loop {
            match self.asked("Page.captureScreenshot", json!({ "format": "png" })) {
                Ok(answer) => break answer["data"].clone(),
                // A page that was just opened replaces another one.
                Err(fault) if fault.contains("Not attached") && began.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(20));
                }
                Err(fault) => panic!("Page.captureScreenshot: {fault}"),
            }
        };
        base64::engine::general_purpose::STANDARD
            .decode(letters.as_str().unwrap())
            .unwrap()
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
