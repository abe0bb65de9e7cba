//! The report: whole without a network, harmless for any text in it, complete without what is missing.

use output::report::{
    CounterRow, FactRow, FileLink, FrameNumbers, Headline, PartRow, PassRow, ReportFrame, ReportImage,
    ReportPlot, RunReport, UnitRow, WarningRow, WorkRow,
};
use output::{Claim, Destination, MeanSd, plot};
use power_model::Part;

const EVIL: &str = "<script>alert('\"1\"')</script><img src=x onerror=alert(2)>";

fn svg() -> String {
    let samples = [(0.0, 1.0)];
    let part = plot::PowerPart { part: Part::Leakage, power_w: vec![1.0; 10] };
    let parts = vec![part];
    let frame = plot::FramePowerPlot {
        subject: EVIL,
        frame: 0,
        bin_s: 1e-3,
        parts,
        samples: &samples,
        frame_j: None,
    };
    frame.picture(&plot::PlotStyle::default()).svg().unwrap()
}

fn frames(text: &str, number: f64) -> Vec<ReportFrame> {
    let numbers = Some(FrameNumbers { time_s: number, energy_j: number, power_w: number });
    let row = ReportFrame {
        frame: 1,
        start_s: number,
        busy_s: Some(number),
        measured: numbers,
        truth: None,
        flags: text.to_owned(),
    };
    vec![row.clone(), ReportFrame { measured: None, ..row }]
}

fn counter(text: &str, number: f64) -> CounterRow {
    let (unit, name, doc) = (text.to_owned(), text.to_owned(), text.to_owned());
    CounterRow { unit, name, doc, total: 1_234_567, per_frame: number, per_pixel: number }
}

/// Every text in it is `text`, every number `number`.
fn report(text: &str, number: f64) -> RunReport<'static> {
    let owned = || text.to_owned();
    let stats = Some(MeanSd { mean: number, sd: Some(number) });
    let fact = FactRow { name: owned(), value: owned(), note: owned() };
    let image = ReportImage { caption: owned(), png: b"\x89PNG?".to_vec(), link: Some(owned()) };
    let work = WorkRow {
        time_s: number,
        time_share: 1.0,
        energy_j: number,
        energy_share: 1.0,
        dram_bytes: 64,
        waits: owned(),
    };
    RunReport {
        title: owned().into(),
        facts: vec![fact.clone()],
        warnings: vec![WarningRow { code: owned(), message: owned(), details: vec![owned(), owned()] }],
        headline: vec![Headline { label: owned(), unit: "J".into(), measured: stats, truth: stats }],
        images: vec![image.clone(), image.clone(), image],
        plots: vec![ReportPlot { caption: owned(), svg: svg(), stem: Some(owned()) }],
        parts: vec![part(text, 99.0 * number, true), part(text, number, false)],
        frames: frames(text, number),
        pixels: 1000,
        passes: vec![PassRow {
            name: owned(),
            passes: 1,
            all: work.clone(),
            draws: vec![work.clone(), work.clone()],
            others: Some(work),
        }],
        units: vec![UnitRow {
            name: owned(),
            doc: owned(),
            busy: Some(number),
            modelled: false,
            note: owned(),
        }],
        counters: vec![counter(text, number)],
        settings: vec![fact.clone()],
        inputs: vec![fact.clone()],
        files: vec![FileLink { path: owned(), what: owned() }],
        host: vec![fact],
    }
}

fn part(text: &str, energy_j: f64, idle: bool) -> PartRow {
    let (name, doc) = (text.to_owned(), text.to_owned());
    PartRow { name, doc, colour: plot::part_colour(Part::Idle).css(), idle, energy_j }
}

/// With V-sync a bar that is 99 % idle said nothing of the rest.
#[test]
fn shares_are_given_of_the_busy_part_too() {
    let page = report("plain", 0.5).html().unwrap();
    assert!(
        page.contains("99.0 %") && page.contains("100.0 %") && page.contains("share while busy"),
        "{page}"
    );
    assert_eq!(page.matches("class=\"stack\"").count(), 2);
}

#[test]
fn nothing_is_asked_of_the_network() {
    let page = report("plain", 0.5).html().unwrap();
    for (at, _) in page.match_indices("http") {
        let rest = &page[at..];
        assert!(rest.starts_with("http://www.w3.org/") || rest.starts_with("http-equiv"), "{}", &rest[..60]);
    }
    for word in ["<link", "@import", "url(", "src=\"/", "src=\"./", "fetch(", "XMLHttpRequest", "<iframe"] {
        assert!(!page.contains(word), "{word}");
    }
    assert!(page.contains("default-src 'none'"), "and the page says so to the browser");
}

#[test]
fn evil_names_stay_text() {
    let page = report(EVIL, 0.5).html().unwrap();
    assert_eq!(page.matches("<script").count(), 1, "our own");
    assert!(!page.contains("<img src=x"));
    assert!(page.contains("&lt;script&gt;"));
}

#[test]
fn links_stay_beside_the_page() {
    let page = report("javascript:alert(1)", 0.5).html().unwrap();
    for (at, _) in page.match_indices("href=\"") {
        let target = &page[at + 6..];
        assert!(target.starts_with("./") || target.starts_with('#'), "{}", &target[..30]);
    }
}

#[test]
fn numbers_have_prefixes_and_warnings_come_first() {
    let page = report("plain", 0.0123).html().unwrap();
    for text in
        ["12.30 ± 12.30 mJ", "12.30 ms", "12.30 µJ", "1,234,567", "1 warning<", "data:image&#x2f;png;base64"]
    {
        let text = text.replace("&#x2f;", "/");
        assert!(page.contains(&text), "{text}");
    }
    assert!(page.find("class=\"warnings\"").unwrap() < page.find("class=\"cards\"").unwrap());
}

#[test]
fn numbers_that_are_none_do_not_break_the_page() {
    for number in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        let page = report("plain", number).html().unwrap();
        assert!(page.ends_with("</html>") || page.ends_with("</html>\n"));
    }
}

#[test]
fn an_empty_report_is_a_page_without_empty_sections() {
    let page = RunReport::default().html().unwrap();
    assert!(page.contains("<h1></h1>") && !page.contains("<section"), "{page}");
}

#[test]
fn the_same_report_gives_the_same_bytes_in_a_file() {
    let temp = tempfile::tempdir().unwrap();
    let mut dir = Destination::new(temp.path()).open([Claim::new("test").files(["report.html"])]).unwrap();
    let report = report("plain", 0.5);
    report.write(&dir, "report.html").unwrap();
    dir.publish().unwrap();
    assert_eq!(std::fs::read_to_string(temp.path().join("report.html")).unwrap(), report.html().unwrap());
}
